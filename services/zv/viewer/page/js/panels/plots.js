// The panel of plots over the last minutes, or a part of the last half hour: rate, latency and losses
// of each node, and any number in any message of the chosen camera, also of a schema that this page
// does not know; the camera's events are marked.

import { byId, drawList, listen, setOptions } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";
import { Chart } from "./chart.js";
import { CameraList } from "./dock.js";
import { EventMarks } from "./event_marks.js";
import { FieldRecorder } from "./field_recorder.js";

const DRAW_MS = 500;
const MINUTE_MS = 60_000;
const COLOURS = 4;
const MOST_FIELDS = 8;
const LONGEST_NAME = 100;
const FIELDS_AT_FIRST = [["centroid", "x"], ["centroid", "y"]];

// Each chart of the nodes with the fields of its lines.
const CHARTS = [
	{ title: "Rate", unit: "Hz", fields: ["rate"] },
	{ title: "Latency from capture", unit: "ms – p50, dashed p99", fields: ["p50", "p99"] },
	{ title: "Lost frames", unit: "per second", fields: ["drops"] },
];

export class PlotsPanel {
	/** `current()` returns the camera in the large view, or null. */
	constructor(system, watches, current) {
		this.visible = false; // set by the dock
		this.system = system;
		this.cameras = new CameraList(byId("plots-camera"), system, current, () => this.draw());
		this.recorder = new FieldRecorder(system, watches);
		this.events = new EventMarks(system, watches);
		this.fields = loadFields();
		this.part = null; // [from, to] of a zoom, by the page's own clock
		this.zoom = (part) => {
			this.part = part;
			this.draw();
		};
		this.charts = CHARTS.map((chart) => {
			const view = new Chart(chart.title, chart.unit, this.zoom);
			byId("plots").append(view.element);
			return { ...chart, view };
		});
		listen("plot-topic", "change", () => this.draw());
		listen("plot-span", "change", () => this.zoom(null));
		listen("plot-newest", "click", () => this.zoom(null));
		listen("plot-add", "click", () =>
			this.setFields([...this.fields, [byId("plot-topic").value, byId("plot-field").value]]));
		system.on("streams", () => this.draw());
		setInterval(() => this.draw(), DRAW_MS);
	}

	draw() {
		if (this.visible) this.cameras.update();
		const { camera } = this.cameras;
		const topics = this.visible
			? [byId("plot-topic").value, ...this.fields.map(([topic]) => topic)].filter(Boolean) : [];
		this.recorder.follow(camera, topics, this.fields);
		this.events.follow(this.visible ? camera : null);
		if (!this.visible) return;
		this.drawMenu(camera);
		byId("plot-newest").disabled = !this.part;
		const style = getComputedStyle(document.documentElement);
		const colour = (name) => style.getPropertyValue(`--${name}`);
		const now = performance.now();
		const [from, to] = this.part ?? [now - byId("plot-span").value * MINUTE_MS, now];
		const span = { from, to, offset: this.system.clockOffset };
		const draw = (view, lines) => view.draw(lines, this.events.marks, span, colour);
		for (const { fields, view } of this.charts) {
			draw(view, linesOf(this.system, camera, fields, colour));
		}
		const views = drawList(byId("field-plots"), this.fields.map((field) => field.join(" ")),
			(key) => this.makeChart(this.fields.find((field) => field.join(" ") === key)));
		for (const [topic, name] of this.fields) {
			const points = this.recorder.points(topic, name, from);
			const line = { name, colour: colour("series-1"), dash: [], points };
			draw(views.get(`${topic} ${name}`), [line]);
		}
	}

	makeChart(field) {
		const [topic, name] = field;
		const title = `${topic[0].toUpperCase()}${topic.slice(1)} ${name}`;
		return new Chart(title, "", this.zoom, () => this.setFields(this.fields.filter((one) => one !== field)));
	}

	/** Offer the message streams of the camera, and the numbers in the newest of the chosen one. */
	drawMenu(camera) {
		const topics = this.system.streams.filter((one) => one.camera === camera
			&& one.kind === "message").map((one) => one.topic);
		const offer = (list, names, title) =>
			setOptions(list, [["", title], ...names.map((name) => [name, name])]);
		offer(byId("plot-topic"), topics, "stream …");
		const topic = byId("plot-topic").value;
		const names = (this.recorder.known.get(topic) ?? []).filter((name) =>
			!this.fields.some((field) => field.join(" ") === `${topic} ${name}`));
		offer(byId("plot-field"), names, !topic ? "number …" : names.length ? "number …" : "none yet");
		byId("plot-add").disabled = !byId("plot-field").value || this.fields.length >= MOST_FIELDS;
	}

	/** Plot a number of a stream of messages; of more plots than there may be, the oldest goes. */
	plot(key, name) {
		const stream = this.system.stream(key);
		if (!stream) return;
		this.cameras.list.value = stream.camera;
		const others = this.fields.filter((field) => field.join(" ") !== `${stream.topic} ${name}`);
		this.setFields([...others.slice(1 - MOST_FIELDS), [stream.topic, name]]);
	}

	setFields(fields) {
		this.fields = fields;
		savePreference("plots", fields);
		this.draw();
	}
}

/**
 * The lines of a chart of a camera's nodes: [{name, colour, dash, points: [{at, value}]}]. A node's
 * report covers all its cameras together, so the line's name has their number.
 */
export function linesOf(system, camera, fields, colour) {
	const nodes = system.nodes.filter((node) => node.cameras?.includes(camera));
	return nodes.flatMap(({ node, service, cameras }, index) => fields.map((field, second) => ({
		name: cameras.length > 1 ? `${service} (all ${cameras.length} cameras)` : service,
		colour: colour(`series-${(index % COLOURS) + 1}`),
		dash: second ? [3, 3] : [],
		points: (system.histories.get(node) ?? []).map((sample) =>
			({ at: sample.at, value: sample[field] ?? null })),
	})));
}

function loadFields() {
	const isName = (text) => typeof text === "string" && text.length > 0
		&& text.length <= LONGEST_NAME;
	const kept = loadPreference("plots", FIELDS_AT_FIRST);
	return (Array.isArray(kept) ? kept : FIELDS_AT_FIRST).slice(0, MOST_FIELDS)
		.filter((field) => Array.isArray(field) && field.length === 2 && field.every(isName));
}
