// Draws lines over the last minutes on a canvas, with their names and newest values below it.

import { median } from "../model/streams.js";
import { HISTORY_MS } from "../model/system.js";
import { element } from "../ui/elements.js";
import { number } from "../ui/format.js";

const MINUTE_MS = 60_000;
const FONT = '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace';
const GAP_MS = 3500;
const GAP_STEPS = 3; // a line is broken where points are further apart, and GAP_MS
const DOT = 3;
const LEFT = 46;
const RIGHT = 8;
const TOP = 6;
const BOTTOM = 18;
const NEAR = 0.2; // values that differ by less than this share of them are shown without the 0

/** A chart's elements; `remove()`, if given, is called by a button. */
export class Chart {
	constructor(title, unit, remove = null) {
		this.canvas = element("canvas", { role: "img", "aria-label": `${title}, 5 minutes` });
		this.legend = element("p", { class: "legend" });
		this.element = element("section", { class: "plot" },
			element("h3", {}, title, element("small", {}, unit)),
			remove && element("button", { type: "button", class: "quiet remove", onclick: remove,
				"aria-label": `Remove the plot of ${title}` }, "✕"),
			this.canvas, this.legend);
	}

	/** Draw lines [{name, colour, dash, points: [{at, value}]}]; `colour(name)` is the theme's. */
	draw(lines, now, colour) {
		drawLines(this.canvas, lines, now, colour);
		drawLegend(this.legend, lines);
	}
}

/** Write each name with the newest values of its lines. */
function drawLegend(legend, lines) {
	legend.replaceChildren(...[...Map.groupBy(lines, (line) => line.name)].map(([name, own]) => {
		const swatch = element("i", { class: "swatch" });
		swatch.style.color = own[0].colour;
		const values = own.map(({ points }) => points.at(-1)?.value)
			.map((value) => number(value, Math.abs(value) < 1 ? 4 : 1));
		return element("span", {}, swatch, `${name} ${values.join(" / ")}`);
	}));
}

/** Draw lines over time up to `now`, ms, with gaps. */
function drawLines(canvas, lines, now, colour) {
	const { clientWidth: width, clientHeight: height } = canvas;
	canvas.width = Math.round(width * devicePixelRatio); // also clears it
	canvas.height = Math.round(height * devicePixelRatio);
	const context = canvas.getContext("2d");
	context.scale(devicePixelRatio, devicePixelRatio);
	const values = lines.flatMap((line) => line.points.map(({ value }) => value));
	const { low, high, ticks } = axis(values);
	const x = (at) => LEFT + (1 - (now - at) / HISTORY_MS) * (width - LEFT - RIGHT);
	const y = (value) => TOP + (high - value) / (high - low) * (height - TOP - BOTTOM);
	context.font = FONT;
	context.fillStyle = colour("dim");
	context.textAlign = "right";
	for (const tick of ticks) {
		context.fillText(tickText(tick), LEFT - 6, y(tick) + 4);
		stroke(context, colour("line"), 1, [[LEFT, y(tick)], [width - RIGHT, y(tick)]]);
	}
	for (let back = 0; back <= HISTORY_MS / MINUTE_MS; back += 1) {
		const text = back === 0 ? "now" : `−${back}`;
		context.fillText(text, x(now - back * MINUTE_MS) + (back ? 8 : 0), height - 4);
	}
	for (const { dash, points, ...line } of lines) {
		context.setLineDash(dash);
		const seen = points.filter(({ at, value }) => at >= now - HISTORY_MS && value !== null);
		for (const part of joinedParts(seen)) {
			stroke(context, line.colour, 1.5, part.map(({ at, value }) => [x(at), y(value)]));
		}
	}
}

/**
 * A scale between round numbers, with a few ticks; null values are left out. It contains 0, unless
 * the values are all far from it and near each other.
 */
export function axis(values) {
	const known = values.filter((value) => value !== null);
	const least = known.reduce((best, value) => Math.min(best, value), known[0] ?? 0);
	const most = known.reduce((best, value) => Math.max(best, value), known[0] ?? 0);
	const isFar = most - least < NEAR * Math.max(Math.abs(least), Math.abs(most));
	const [from, to] = isFar && most > least ? [least, most] : [Math.min(0, least), Math.max(0, most)];
	const span = to - from || 1;
	const power = 10 ** Math.floor(Math.log10(span / 3));
	const step = [1, 2, 2.5, 5, 10].map((by) => by * power).find((by) => by >= span / 3);
	const first = Math.floor(from / step + 1e-9);
	const last = Math.max(first + 1, Math.ceil((from + span) / step - 1e-9));
	const ticks = Array.from({ length: last - first + 1 }, (_, index) =>
		Number(((first + index) * step).toPrecision(12)));
	return { low: ticks[0], high: ticks.at(-1), ticks };
}

/** A number of the scale, short enough for the margin: "250", "1.5e+9". */
function tickText(tick) {
	const text = String(tick);
	return text.length <= 6 ? text : tick.toExponential(1).replace("e+", "e");
}

/** The parts of a line whose points {at} follow one another as usual, however slow that is. */
export function joinedParts(points) {
	const steps = points.slice(1).map(({ at }, index) => at - points[index].at);
	const longest = Math.max(GAP_MS, GAP_STEPS * (median(steps) ?? 0));
	const parts = [];
	points.forEach((point, index) => {
		if (!index || steps[index - 1] > longest) parts.push([]);
		parts.at(-1).push(point);
	});
	return parts;
}

/** Draw a line through points [x, y], or a dot if there is but one. */
function stroke(context, colour, width, points) {
	context.strokeStyle = colour;
	context.lineWidth = width;
	context.beginPath();
	for (const [x, y] of points) context.lineTo(x, y);
	context.stroke();
	if (points.length > 1) return;
	const [[x, y]] = points;
	context.fillStyle = colour;
	context.fillRect(x - DOT / 2, y - DOT / 2, DOT, DOT);
}
