// The panel of plots over the last minutes, or a part of the last half hour: rate, latency and losses
// of each node, and any number in any message of the chosen camera, also of a schema that this page
// does not know; the camera's events are marked.

import { byId, drawList, listen, setOptions } from "../ui/elements.js";
import { loadPreference, savePreference, themeColour } from "../ui/preferences.js";
import { Chart } from "./chart.js";
import { cameraList } from "./dock.js";
import { eventMarks } from "./event_marks.js";
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

const keyOf = (field) => field.join(" ");

/** The panel; `current()` returns the camera in the large view, or null. */
export function plotsPanel(system, watches, current) {
	const panel = { visible: false, draw, plot }; // set by the dock
	const list = byId("plots-camera");
	const updateCameras = cameraList(list, system, current, draw);
	const recorder = new FieldRecorder(system, watches);
	const events = eventMarks(system, watches);
	let fields = loadFields();
	/** @type {number[] | null} */
	let part = null; // [from, to] of a zoom, by the page's own clock
	const charts = CHARTS.map((chart) => {
		const view = new Chart(chart.title, chart.unit, zoom);
		byId("plots").append(view.element);
		return { ...chart, view };
	});

	function zoom(wanted) {
		part = wanted;
		draw();
	}

	function draw() {
		const camera = panel.visible ? updateCameras() : list.value;
		const topics = panel.visible
			? [byId("plot-topic").value, ...fields.map(([topic]) => topic)].filter(Boolean) : [];
		recorder.follow(camera, topics, fields);
		events.follow(panel.visible ? camera : null);
		if (!panel.visible) return;
		drawMenu(camera);
		byId("plot-newest").disabled = !part;
		const now = performance.now();
		const [from, to] = part ?? [now - byId("plot-span").value * MINUTE_MS, now];
		const span = { from, to, offset: system.clockOffset };
		const drawLines = (view, lines) => view.draw(lines, events.marks(), span);
		for (const chart of charts) {
			drawLines(chart.view, linesOf(system, camera, chart.fields, themeColour));
		}
		const views = drawList(byId("field-plots"), fields.map(keyOf), makeChart);
		for (const [topic, name] of fields) {
			const points = recorder.points(topic, name, from);
			const line = { name, colour: themeColour("series-1"), dash: [], points };
			drawLines(views.get(keyOf([topic, name])), [line]);
		}
	}

	function makeChart(key) {
		const title = `${key[0].toUpperCase()}${key.slice(1)}`;
		const remove = () => setFields(fields.filter((field) => keyOf(field) !== key));
		return new Chart(title, "", zoom, remove);
	}

	/** Offer the message streams of the camera, and the numbers in the newest of the chosen one. */
	function drawMenu(camera) {
		const topics = system.streams.filter((one) => one.camera === camera
			&& one.kind === "message").map((one) => one.topic);
		const offer = (list, names, title) =>
			setOptions(list, [["", title], ...names.map((name) => [name, name])]);
		offer(byId("plot-topic"), topics, "stream …");
		const topic = byId("plot-topic").value;
		const names = (recorder.known.get(topic) ?? []).filter((name) =>
			!fields.some((field) => keyOf(field) === keyOf([topic, name])));
		offer(byId("plot-field"), names, !topic ? "number …" : names.length ? "number …" : "none yet");
		byId("plot-add").disabled = !byId("plot-field").value || fields.length >= MOST_FIELDS;
	}

	/** Plot a number of a stream of messages; of more plots than there may be, the oldest goes. */
	function plot(key, name) {
		const stream = system.stream(key);
		if (!stream) return;
		list.value = stream.camera;
		const others = fields.filter((field) => keyOf(field) !== keyOf([stream.topic, name]));
		setFields([...others.slice(1 - MOST_FIELDS), [stream.topic, name]]);
	}

	function setFields(wanted) {
		fields = wanted;
		savePreference("plots", fields);
		draw();
	}

	listen("plot-topic", "change", draw);
	listen("plot-span", "change", () => zoom(null));
	listen("plot-newest", "click", () => zoom(null));
	listen("plot-add", "click", () =>
		setFields([...fields, [byId("plot-topic").value, byId("plot-field").value]]));
	system.on("streams", draw);
	setInterval(draw, DRAW_MS);
	return panel;
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
