// The panel of plots over the last minutes: rate, latency, drops of each node, and the centroid.

import { byId, element } from "../ui/elements.js";
import { number } from "../ui/format.js";
import { CameraList } from "./dock.js";

const MINUTE_MS = 60_000;
const SPAN_MS = 5 * MINUTE_MS;
const DRAW_MS = 500;
const POINTS_KEPT = 9000; // five minutes at 30 Hz
const POINTS_DRAWN = 1200;
const COLOURS = 4;
const FONT = '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace';
const GAP_MS = 3500;
const LEFT = 46;
const RIGHT = 8;
const TOP = 6;
const BOTTOM = 18;

// Each chart with the fields of its lines; those of the centroid do not belong to nodes.
const CHARTS = [
	{ title: "Rate", unit: "Hz", fields: ["rate"] },
	{ title: "Latency from capture", unit: "ms – p50, dashed p99", fields: ["p50", "p99"] },
	{ title: "Drops", unit: "per second", fields: ["drops"] },
	{ title: "Centroid x", unit: "pixels", fields: ["x"], isCentroid: true },
	{ title: "Centroid y", unit: "pixels", fields: ["y"], isCentroid: true },
];

export class PlotsPanel {
	/** `current()` returns the camera in the large view, or null. */
	constructor(system, watches, current) {
		Object.assign(this, { system, watches, centroids: [] });
		this.cameras = new CameraList(byId("plots-camera"), system, current, () => this.draw());
		this.charts = CHARTS.map((chart) => {
			const canvas = element("canvas", { role: "img", "aria-label": `${chart.title}, 5 minutes` });
			const legend = element("p", { class: "legend" });
			byId("plots").append(element("section", { class: "plot" },
				element("h3", {}, chart.title, element("small", {}, chart.unit)), canvas, legend));
			return { ...chart, canvas, legend };
		});
		system.on("streams", () => this.draw());
		setInterval(() => this.draw(), DRAW_MS);
	}

	draw() {
		if (this.visible) this.cameras.update();
		this.follow();
		if (!this.visible) return;
		const style = getComputedStyle(document.documentElement);
		const colour = (name) => style.getPropertyValue(`--${name}`);
		for (const chart of this.charts) {
			const lines = this.linesOf(chart, colour);
			drawChart(chart.canvas, lines, this.system.now, colour);
			drawLegend(chart.legend, lines);
		}
	}

	/** Watch the centroid of the chosen camera while the panel is visible. */
	follow() {
		const stream = this.system.streams.find((one) => one.camera === this.cameras.camera
			&& one.type === "vision.Centroid.v1");
		const key = this.visible ? stream?.key : undefined;
		if (key === this.followed) return;
		this.stop?.();
		this.stop = null;
		this.followed = key;
		if (!key) return;
		if (this.centroids.key !== key) this.centroids = Object.assign([], { key });
		this.stop = this.watches.watchMessages(key, ({ body: { x, y } }) => {
			this.centroids.push({ at: this.system.now, x, y }); // the camera's clock may differ
			if (this.centroids.length > POINTS_KEPT) this.centroids.shift();
		});
	}

	/** The lines of a chart: [{name, colour, dash, points: [{at, value}]}]. */
	linesOf({ fields, isCentroid }, colour) {
		const step = Math.ceil(this.centroids.length / POINTS_DRAWN);
		const sources = isCentroid
			? [[fields[0], this.centroids.filter((_, index) => index % step === 0)]]
			: this.system.nodes.filter((node) => node.cameras?.includes(this.cameras.camera))
				.map((node) => [node.service, this.system.histories.get(node.node) ?? []]);
		return sources.flatMap(([name, samples], index) => fields.map((field, second) => ({
			name,
			colour: colour(`series-${(index % COLOURS) + 1}`),
			dash: second ? [3, 3] : [],
			points: samples.map((sample) => ({ at: sample.at, value: sample[field] ?? null })),
		})));
	}
}

/** Write each name with the newest values of its lines. */
function drawLegend(legend, lines) {
	legend.replaceChildren(...[...Map.groupBy(lines, (line) => line.name)].map(([name, own]) => {
		const swatch = element("i", { class: "swatch" });
		swatch.style.color = own[0].colour;
		const values = own.map(({ points }) => number(points.at(-1)?.value, 1));
		return element("span", {}, swatch, `${name} ${values.join(" / ")}`);
	}));
}

/** Draw lines over time up to `now`, ms, with gaps; `colour(name)` returns the theme's colour. */
function drawChart(canvas, lines, now, colour) {
	const { clientWidth: width, clientHeight: height } = canvas;
	canvas.width = Math.round(width * devicePixelRatio); // also clears it
	canvas.height = Math.round(height * devicePixelRatio);
	const context = canvas.getContext("2d");
	context.scale(devicePixelRatio, devicePixelRatio);
	const { high, ticks } = axis(lines.flatMap((line) => line.points.map(({ value }) => value)));
	const x = (at) => LEFT + (1 - (now - at) / SPAN_MS) * (width - LEFT - RIGHT);
	const y = (value) => TOP + (1 - value / high) * (height - TOP - BOTTOM);
	context.font = FONT;
	context.fillStyle = colour("dim");
	context.textAlign = "right";
	for (const tick of ticks) {
		context.fillText(String(tick), LEFT - 6, y(tick) + 4);
		stroke(context, colour("line"), 1, [[LEFT, y(tick)], [width - RIGHT, y(tick)]]);
	}
	for (let back = 0; back <= SPAN_MS / MINUTE_MS; back += 1) {
		const text = back === 0 ? "now" : `−${back}`;
		context.fillText(text, x(now - back * MINUTE_MS) + (back ? 8 : 0), height - 4);
	}
	for (const { dash, points, ...line } of lines) {
		context.setLineDash(dash);
		const seen = points.filter(({ at, value }) => at >= now - SPAN_MS && value !== null);
		stroke(context, line.colour, 1.5, seen.map(({ at, value }) => [x(at), y(value), at]));
	}
}

/** A scale from 0 to a round number, with a few ticks; null values are left out. */
export function axis(values) {
	const top = values.reduce((most, value) => Math.max(most, value), 0) || 1;
	const power = 10 ** Math.floor(Math.log10(top / 3));
	const step = [1, 2, 2.5, 5, 10].map((by) => by * power).find((by) => by >= top / 3);
	const count = Math.ceil(top / step - 1e-9);
	const ticks = Array.from({ length: count + 1 }, (_, index) =>
		Number((index * step).toPrecision(6)));
	return { high: ticks.at(-1), ticks };
}

/** Draw a line through points [x, y, at], broken where `at` jumps. */
function stroke(context, colour, width, points) {
	context.strokeStyle = colour;
	context.lineWidth = width;
	context.beginPath();
	points.forEach(([x, y, at], index) => {
		const isJoined = index && !(at - points[index - 1][2] > GAP_MS);
		if (isJoined) context.lineTo(x, y);
		else context.moveTo(x, y);
	});
	context.stroke();
}
