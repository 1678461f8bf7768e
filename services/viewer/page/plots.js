// The panel of plots over the last minutes: rate, latency, drops of each node, and the centroid.

import { drawChart } from "./chart.js";
import { byId, element } from "./elements.js";
import { number } from "./format.js";

const SPAN_MS = 5 * 60 * 1000;
const DRAW_MS = 500;
const POINTS_KEPT = 9000; // five minutes at 30 Hz
const POINTS_DRAWN = 1200;
const COLOURS = 4;
const FONT = '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace';

// Each with the fields of its lines; those of the centroid are not of nodes.
const CHARTS = [
	{ title: "Rate", unit: "Hz", fields: ["rate"] },
	{ title: "Latency from capture", unit: "ms – p50, dashed p99", fields: ["p50", "p99"] },
	{ title: "Drops", unit: "per second", fields: ["drops"] },
	{ title: "Centroid x", unit: "pixels", fields: ["x"], isCentroid: true },
	{ title: "Centroid y", unit: "pixels", fields: ["y"], isCentroid: true },
];

export class PlotsPanel {
	constructor(system, watches, camera) {
		Object.assign(this, { system, watches, camera, visible: false, centroids: [] });
		this.choice = byId("plots-camera");
		this.choice.addEventListener("change", () => this.follow());
		this.charts = CHARTS.map((chart) => {
			const canvas = element("canvas", { role: "img", "aria-label": `${chart.title}, 5 minutes` });
			const legend = element("p", { class: "legend" });
			byId("plots").append(element("section", { class: "plot" },
				element("h3", {}, chart.title, element("small", {}, chart.unit)), canvas, legend));
			return { ...chart, canvas, legend };
		});
		system.on("streams", () => this.arrange());
		setInterval(() => visibleOnly(this), DRAW_MS);
	}

	show(visible) {
		this.visible = visible;
		this.arrange();
		visibleOnly(this);
	}

	/** Offer the cameras that there are, and choose the one that is looked at now. */
	arrange() {
		const { cameras } = this.system;
		const chosen = this.camera() !== this.before && this.camera() ? this.camera()
			: this.choice.value;
		this.before = this.camera();
		if ([...this.choice.options].map((option) => option.value).join() !== cameras.join()) {
			this.choice.replaceChildren(...cameras.map((name) => element("option", {}, name)));
		}
		this.choice.value = cameras.includes(chosen) ? chosen : cameras[0];
		this.follow();
	}

	/** Watch the centroid of the camera that is chosen, while the panel is seen. */
	follow() {
		const stream = this.system.streams.find((one) => one.camera === this.choice.value
			&& one.type === "vision.Centroid.v1");
		const key = this.visible ? stream?.key : undefined;
		if (key === this.followed) return;
		this.stop?.();
		this.stop = null;
		this.followed = key;
		if (!key) return;
		if (this.centroids.key !== key) this.centroids = Object.assign([], { key });
		this.stop = this.watches.messages(key, ({ body: { x, y } }) => {
			this.centroids.push({ at: this.system.now, x, y }); // the camera's clock may differ
			if (this.centroids.length > POINTS_KEPT) this.centroids.shift();
		});
	}

	draw() {
		const span = { from: this.system.now - SPAN_MS, to: this.system.now };
		const style = getComputedStyle(document.documentElement);
		const look = { grid: style.getPropertyValue("--line"), text: style.getPropertyValue("--dim"),
			font: FONT };
		for (const chart of this.charts) {
			const lines = this.linesOf(chart, style);
			drawChart(chart.canvas, lines, span, look);
			writeLegend(chart, lines);
		}
	}

	linesOf({ fields, isCentroid }, style) {
		const step = Math.ceil(this.centroids.length / POINTS_DRAWN);
		const sources = isCentroid
			? [[fields[0], this.centroids.filter((_, index) => index % step === 0)]]
			: this.system.nodes.filter((node) => node.cameras?.includes(this.choice.value))
				.map((node) => [node.service, this.system.histories.get(node.node) ?? []]);
		return sources.flatMap(([name, samples], index) => fields.map((field, second) => ({
			name,
			colour: style.getPropertyValue(`--series-${(index % COLOURS) + 1}`),
			dash: second ? [3, 3] : [],
			points: samples.map((sample) => ({ at: sample.at, value: sample[field] ?? null })),
		})));
	}
}

function visibleOnly(panel) {
	if (panel.visible) panel.draw();
}

/** Each line's name and newest value. */
function writeLegend(chart, lines) {
	const named = new Map();
	for (const { name, colour, points } of lines) {
		const value = points.at(-1)?.value ?? null;
		const entry = named.get(name) ?? { colour, values: [] };
		entry.values.push(value === null ? "–" : number(value, 1));
		named.set(name, entry);
	}
	chart.legend.replaceChildren(...[...named].map(([name, { colour, values }]) => {
		const key = element("i", { class: "key" });
		key.style.color = colour;
		return element("span", {}, key, `${name} ${values.join(" / ")}`);
	}));
}
