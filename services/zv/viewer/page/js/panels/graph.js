// The panel with the graph of publishers, keys and subscribers, as SVG.

import { topicName } from "../model/streams.js";
import { byId, svg } from "../ui/elements.js";
import { cameraList } from "./dock.js";

const ROW = 22;
const GAP = 12;
const BOX_GAP = 6;
const NODE_WIDTH = 106;
const KEY_LEFT = NODE_WIDTH + 14;
const CURVE_WIDTH = 34;
const NARROWEST = 356;
const WIDEST = 600;
const LONGEST_NAME = 15;
const LETTER_WIDTH = 6.7;

/** The panel; `current()` returns the camera in the large view, or null. */
export function graphPanel(system, current) {
	const panel = { visible: false, draw }; // set by the dock
	const list = byId("graph-camera");
	const updateCameras = cameraList(list, system, current, draw, { withAll: true });
	let drawn = ""; // of which state the graph is

	function draw() {
		if (!panel.visible) return;
		const camera = updateCameras();
		const ofCamera = (keys) => (keys ?? []).filter((key) => !camera
			|| key.split("/")[1] === camera || key.includes("*"));
		const nodes = system.nodes
			.filter((node) => !camera || !node.cameras?.length || node.cameras.includes(camera))
			.map((node) => ({ node: node.node, alive: node.alive,
				publishes: ofCamera(node.publishes), subscribes: ofCamera(node.subscribes) }));
		const width = Math.min(WIDEST, Math.max(NARROWEST, byId("graph").clientWidth - 28));
		const keys = nodes.flatMap((node) => [...node.publishes, ...node.subscribes]);
		const kinds = keys.map((key) => system.stream(key)?.kind);
		const state = JSON.stringify([camera, width, nodes, kinds, ...system.matches]);
		if (state === drawn) return;
		drawn = state;
		const layout = layOut(nodes, system.matches);
		byId("graph").replaceChildren(...layout.rows.length ? [drawing(layout, width)] : []);
	}

	function drawing({ rows, senders, receivers, height }, width) {
		const right = width - NODE_WIDTH - 1;
		const middles = new Map(receivers.map((one) => [one.node, one.y + ROW / 2]));
		return svg("svg", { viewBox: `0 -2 ${width} ${height + 4}`, width, height: height + 4,
			role: "group", "aria-label": "Graph of nodes and keys", class: "graph-drawing" },
		rows.flatMap((row) => wires(row, middles, nameOf(row.key), right)), rows.map(keyText),
		senders.map((one) => nodeBox(one, 1)), receivers.map((one) => nodeBox(one, right)));
	}

	/** A short name for a key: its topic, with the camera if there are several. */
	function nameOf(key) {
		const stream = system.stream(key);
		if (!stream) return key;
		return list.value ? topicName(stream) : `${stream.camera}/${topicName(stream)}`;
	}

	function keyText({ key, y, receivers, sender }) {
		const isPicture = system.stream(key)?.kind === "picture";
		const kinds = [!receivers.length && "unheard", !sender && "unsent", isPicture && "picture"];
		return svg(isPicture ? "a" : "g", { class: ["key", ...kinds].filter(Boolean).join(" "),
			href: isPicture && `#${key}` },
		svg("title", {}, `${key}${receivers.length ? "" : " – nobody subscribes"}`),
		svg("text", { x: KEY_LEFT + 5, y: y + ROW / 2 + 4 }, nameOf(key)));
	}

	system.on("nodes streams matches", draw);
	new ResizeObserver(draw).observe(byId("graph"));
	return panel;
}

/** The lines of a key: from its sender, and to all its receivers. */
function wires({ y, sender, receivers }, middles, name, right) {
	const middle = y + ROW / 2;
	const from = right - CURVE_WIDTH;
	const bend = (from + right) / 2;
	const begin = Math.min(from, KEY_LEFT + 10 + LETTER_WIDTH * name.length);
	return [
		sender && svg("path", { class: "wire", d: `M${NODE_WIDTH + 1} ${middle} H${KEY_LEFT}` }),
		...receivers.map((one) => middles.get(one)).flatMap((to) => [
			svg("path", { class: "wire",
				d: `M${begin} ${middle} H${from} C${bend} ${middle} ${bend} ${to} ${right - 6} ${to}` }),
			svg("path", { class: "head", d: `M${right - 7} ${to - 3.5} L${right} ${to} l-7 3.5 Z` }),
		]),
	];
}

function nodeBox({ node, alive, y, height }, x) {
	const isLong = node.length > LONGEST_NAME;
	return svg("g", { class: alive ? "node" : "node gone" },
		svg("title", {}, `${node}${alive ? "" : " – gone"}`),
		svg("rect", { x, y: y + 1, width: NODE_WIDTH, height: height - 2 }),
		svg("text", { x: x + 8, y: y + ROW / 2 + 4 },
			isLong ? `${node.slice(0, LONGEST_NAME - 1)}…` : node));
}

/**
 * Lay out nodes ({node, alive, publishes, subscribes}) in columns; a node that publishes and
 * subscribes is in both. `matches`, a Map, has the streams that an expression with wildcards matches.
 * Returns {rows, senders, receivers, height}: rows [{key, y, sender, receivers}], senders and
 * receivers [{node, alive, y, height}].
 */
export function layOut(nodes, matches = new Map()) {
	const keysOf = (expression) => matches.get(expression) ?? [expression];
	const listeners = nodes.map(({ node, subscribes }) =>
		({ node, heard: new Set([...subscribes, ...subscribes.flatMap(keysOf)]) }));
	const rows = [];
	const senders = [];
	let y = 0;
	const add = (key, sender) => {
		const receivers = listeners.filter(({ heard }) => heard.has(key)).map(({ node }) => node);
		rows.push({ key, y, sender, receivers });
		y += ROW;
	};
	for (const { node, alive, publishes } of nodes.filter((one) => one.publishes.length)) {
		const top = y;
		for (const key of publishes) add(key, node);
		senders.push({ node, alive, y: top, height: y - top });
		y += GAP;
	}
	const published = new Set(nodes.flatMap((node) => node.publishes));
	const unsent = new Set(nodes.flatMap((node) => node.subscribes)
		.filter((expression) => !keysOf(expression).some((key) => published.has(key))));
	for (const key of unsent) add(key, null);
	return { rows, senders, receivers: placeReceivers(nodes, rows, y), height: y };
}

/** Place each subscriber at the middle of its keys, in order, without overlaps. */
function placeReceivers(nodes, rows, height) {
	const receivers = nodes
		.map((node) => ({ ...node, own: rows.filter((row) => row.receivers.includes(node.node)) }))
		.filter(({ own }) => own.length)
		.map((one) => ({ ...one, y: one.own.reduce((sum, row) => sum + row.y, 0) / one.own.length }))
		.sort((a, b) => a.y - b.y);
	let end = -BOX_GAP;
	for (const one of receivers) {
		one.y = Math.max(end + BOX_GAP, one.y);
		end = one.y + ROW;
	}
	const over = Math.max(0, end - height);
	return receivers.map((one) => ({ ...one, y: Math.max(0, one.y - over), height: ROW }));
}
