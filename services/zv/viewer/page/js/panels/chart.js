// Draws lines over time by uPlot, with the moments of events; names and values stand below. A
// pointer shows the values at its moment in all charts, a drag zooms into a part of the time.

import { median } from "../model/streams.js";
import { element, setText } from "../ui/elements.js";
import { clock, duration, number } from "../ui/format.js";
import { themeColour } from "../ui/preferences.js";

const FONT = '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace';
const HEIGHT = 116;
const GAP_MS = 3500;
const GAP_STEPS = 3; // a line is broken where points are further apart, and GAP_MS
const MINUTE_MS = 60_000;
const NEAR_PX = 4; // events under the pointer
const REACH_PX = 20; // and values
const MARK_PX = 6;
const MOST_WORDS = 4; // of events at one place
const LONGEST_TICK = 6;

/** A chart's elements. */
export class Chart {
	/**
	 * `zoom(part)` is called with [from, to], or null for the newest; `remove()` by a button.
	 * @param {(() => void) | null} remove
	 */
	constructor(title, unit, zoom, remove = null) {
		this.title = title;
		this.zoom = zoom;
		this.place = element("div");
		this.moment = element("small");
		this.legend = element("p", { class: "legend" });
		this.element = element("section", { class: "plot" },
			element("h3", {}, title, element("small", {}, unit), this.moment),
			remove && element("button", { type: "button", class: "quiet remove", onclick: remove,
				"aria-label": `Remove the plot of ${title}` }, "✕"),
			this.place, this.legend);
	}

	/**
	 * Draw lines [{name, colour, dash, points: [{at, value}]}] and marks [{at, words}] between
	 * `from` and `to`; `offset` makes their times milliseconds since 1970.
	 */
	draw(lines, marks, { from, to, offset }) {
		this.lines = lines;
		this.marks = marks;
		this.offset = offset;
		const size = { width: this.place.clientWidth, height: HEIGHT };
		const look = JSON.stringify([themeColour("dim"), lines.map(({ colour, dash }) => [colour, dash])]);
		if (look !== this.look) {
			this.plot?.destroy();
			this.plot = new uPlot({ ...size, ...this.options() }, null, this.place);
			Object.assign(this.plot.ctx.canvas, { role: "img", ariaLabel: `${this.title} over time` });
		}
		this.look = look;
		if (this.plot.width !== size.width) this.plot.setSize(size);
		const tables = lines.map(({ points }) => columns(points, offset));
		this.plot.batch(() => {
			this.plot.setData(tables.length ? uPlot.join(tables) : [[]], false);
			this.plot.setScale("x", { min: from + offset, max: to + offset });
		});
		this.drawLegend();
	}

	options() {
		const axis = { font: FONT, stroke: themeColour("dim"), ticks: { show: false } };
		const times = (_plot, ticks, _axis, _space, step) =>
			ticks.map((at) => clock(1000 * Math.round(at / 1000)).slice(0, step < MINUTE_MS ? 8 : 5));
		return {
			ms: 1,
			padding: [6, 8, 0, 0],
			legend: { show: false },
			axes: [
				{ ...axis, size: 20, gap: 3, space: 60, values: times, grid: { show: false } },
				{ ...axis, size: 46, gap: 4, space: 20, values: (_plot, ticks) => ticks.map(tickText),
					grid: { stroke: themeColour("line"), width: 1 } },
			],
			series: [{}, ...this.lines.map(({ colour: stroke, dash }) => ({ stroke, dash, width: 1.5,
				points: { show: true, size: 4, fill: stroke, filter: (plot, at) => lonely(plot.data[at]) } }))],
			cursor: {
				y: false,
				points: { size: 5 },
				hover: { prox: REACH_PX },
				drag: { setScale: false },
				sync: { key: "plots", filters: { pub: (type) => type.startsWith("mousem") || type === "mouseleave" } },
				bind: { dblclick: () => () => this.zoom(null) },
			},
			hooks: {
				setCursor: [() => this.drawLegend()],
				setSelect: [(plot) => this.select(plot)],
				draw: [(plot) => this.drawMarks(plot)],
			},
		};
	}

	/** Zoom into what was chosen by a drag. */
	select(plot) {
		const { left, width } = plot.select;
		if (!width) return;
		const [from, to] = [left, left + width].map((x) => plot.posToVal(x, "x") - this.offset);
		plot.setSelect({ left: 0, width: 0 }, false);
		this.zoom([from, to]);
	}

	drawMarks({ ctx: context, bbox, valToPos }) {
		context.save(); // the library remembers what it has set
		context.fillStyle = themeColour("accent");
		for (const { at } of this.marks) {
			const x = valToPos(at + this.offset, "x", true);
			if (x < bbox.left || x > bbox.left + bbox.width) continue;
			context.fillRect(Math.round(x), bbox.top, devicePixelRatio, MARK_PX * devicePixelRatio);
		}
		context.restore();
	}

	/** Write each name with the values of its lines: those under the pointer, else the newest. */
	drawLegend() {
		const { cursor, data, posToVal, valToPos } = this.plot;
		const isPointed = cursor.left >= 0 && data[0].length > 0;
		const values = this.lines.map(({ points }, index) => isPointed
			? data[index + 1][cursor.idxs[index + 1]] : points.at(-1)?.value);
		const groups = Map.groupBy(this.lines.keys(), (index) => this.lines[index].name);
		const parts = [...groups].map(([name, own]) => {
			const swatch = element("i", { class: "swatch" });
			swatch.style.color = this.lines[own[0]].colour;
			const texts = own.map((index) => number(values[index], Math.abs(values[index]) < 1 ? 4 : 1));
			return element("span", {}, swatch, `${name} ${texts.join(" / ")}`);
		});
		setText(this.moment, isPointed ? clock(posToVal(cursor.left, "x")) : this.age());
		const near = !isPointed || !this.place.matches(":hover") ? [] : this.marks.filter(({ at }) =>
			Math.abs(valToPos(at + this.offset, "x") - cursor.left) < NEAR_PX);
		const words = near.slice(-MOST_WORDS).map((mark) => element("b", {}, mark.words));
		const others = near.length - words.length;
		this.legend.replaceChildren(...parts, ...words, others ? `and ${others} more events` : "");
	}

	/** How old the newest value is, if it is older than what is shown. */
	age() {
		const newest = Math.max(...this.lines.map(({ points }) => points.at(-1)?.at ?? -Infinity));
		const { min, max } = this.plot.scales.x;
		return newest + this.offset < min && newest > -Infinity
			? `newest value ${duration(max - newest - this.offset)} before` : "";
	}
}

/** A number of the scale, short enough for the margin: "250", "1.5e9". */
function tickText(tick) {
	const text = String(Number(tick?.toPrecision(12)));
	return text.length <= LONGEST_TICK ? text : tick.toExponential(1).replace("e+", "e");
}

/**
 * Points {at, value} as columns for uPlot. A null breaks the line where they fail to come for longer
 * than usual, however slow that is.
 */
export function columns(points, offset = 0) {
	const steps = points.slice(1).map(({ at }, index) => at - points[index].at);
	const longest = Math.max(GAP_MS, GAP_STEPS * (median(steps) ?? 0));
	const drawn = points.flatMap((point, index) => steps[index - 1] > longest
		? [{ at: (point.at + points[index - 1].at) / 2, value: null }, point] : [point]);
	return [drawn.map(({ at }) => at + offset), drawn.map(({ value }) => value)];
}

/** The places of values that have none beside them, which a line does not show. */
export function lonely(values) {
	const known = [...values.keys()].filter((at) => values[at] !== undefined);
	const isNone = (at) => (values[at] ?? null) === null;
	return known.filter((at, index) =>
		!isNone(at) && isNone(known[index - 1]) && isNone(known[index + 1]));
}
