// The panel with the graph of nodes and keys, as SVG.

import { byId, element, svg } from "./elements.js";
import { layOut, ROW } from "./layering.js";
import { topicName } from "./naming.js";

const NODE_WIDTH = 106;
const KEY_LEFT = NODE_WIDTH + 14;
const CURVE_WIDTH = 34;
const NARROWEST = 356;
const WIDEST = 600;
const LONGEST_NAME = 15;
const LETTER_WIDTH = 6.7;

export class GraphPanel {
	constructor(system, camera) {
		Object.assign(this, { system, camera, visible: false, choice: byId("graph-camera") });
		this.choice.addEventListener("change", () => this.draw());
		system.on("nodes", () => this.draw());
		system.on("streams", () => this.draw());
		new ResizeObserver(() => this.draw()).observe(byId("graph"));
	}

	show(visible) {
		this.visible = visible;
		this.draw();
	}

	arrange() {
		if (this.camera() && this.choice.value) this.choice.value = this.camera();
		this.draw();
	}

	draw() {
		if (!this.visible) return;
		this.offerCameras();
		const camera = this.choice.value;
		const ofCamera = (keys) => (keys ?? []).filter((key) => !camera
			|| key.split("/")[1] === camera || key.includes("*"));
		const nodes = this.system.nodes
			.filter((node) => !camera || !node.cameras?.length || node.cameras.includes(camera))
			.map((node) => ({ node: node.node, alive: node.alive,
				publishes: ofCamera(node.publishes), subscribes: ofCamera(node.subscribes) }));
		const width = Math.min(WIDEST, Math.max(NARROWEST, byId("graph").clientWidth - 28));
		const state = JSON.stringify([camera, width, nodes]);
		if (state === this.state) return;
		this.state = state;
		const laid = layOut(nodes);
		byId("graph").replaceChildren(laid.rows.length ? this.drawing(laid, nodes, width)
			: element("p", { class: "empty" }, "No node publishes or subscribes yet."));
	}

	offerCameras() {
		const wanted = [...this.system.cameras, ""];
		if ([...this.choice.options].map((option) => option.value).join() === wanted.join()) return;
		const before = this.choice.options.length ? this.choice.value : this.camera();
		this.choice.replaceChildren(...wanted.map((camera) =>
			element("option", { value: camera }, camera || "all cameras")));
		this.choice.value = wanted.includes(before) ? before : wanted[0];
	}

	drawing({ rows, senders, receivers, height }, nodes, width) {
		const right = width - NODE_WIDTH - 1;
		const gone = new Set(nodes.filter((node) => !node.alive).map((node) => node.node));
		const placeOf = new Map(receivers.map((one) => [one.node, one.y + ROW / 2]));
		return svg("svg", { viewBox: `0 -2 ${width} ${height + 4}`, width, height: height + 4,
			role: "img", "aria-label": "Graph of nodes and keys", class: "graph-drawing" },
		rows.flatMap((row) => lines(row, placeOf, this.name(row.key), right - CURVE_WIDTH, right)),
		rows.map((row) => this.key(row)),
		senders.map((one) => nodeBox(one, 1, gone)),
		receivers.map((one) => nodeBox(one, right, gone)));
	}

	/** A key in short: its topic, with the camera where there are several. */
	name(key) {
		const stream = this.system.stream(key);
		if (!stream) return key;
		return this.choice.value ? topicName(stream) : `${stream.camera}/${topicName(stream)}`;
	}

	key({ key, y, receivers, sender }) {
		const stream = this.system.stream(key);
		const kind = `key ${receivers.length ? "" : "unheard"} ${sender ? "" : "unsent"}`;
		const parts = [
			svg("title", {}, `${key}${receivers.length ? "" : " – nobody subscribes"}`),
			svg("text", { x: KEY_LEFT + 5, y: y + ROW / 2 + 4 }, this.name(key)),
		];
		return stream?.kind === "picture"
			? svg("a", { class: `${kind} picture`, href: `#${key}` }, parts)
			: svg("g", { class: kind }, parts);
	}
}

/** The lines of a key: from who sends it, to all who hear it. */
function lines({ y, sender, receivers }, placeOf, name, from, end) {
	const middle = y + ROW / 2;
	const bend = (from + end) / 2;
	const begin = Math.min(from, KEY_LEFT + 10 + LETTER_WIDTH * name.length);
	return [
		sender && svg("path", { class: "wire", d: `M${NODE_WIDTH + 1} ${middle} H${KEY_LEFT}` }),
		...receivers.map((one) => placeOf.get(one)).flatMap((to) => [
			svg("path", { class: "wire",
				d: `M${begin} ${middle} H${from} C${bend} ${middle} ${bend} ${to} ${end - 6} ${to}` }),
			svg("path", { class: "head", d: `M${end - 7} ${to - 3.5} L${end} ${to} l-7 3.5 Z` }),
		]),
	];
}

function nodeBox({ node, y, height }, x, gone) {
	const isLong = node.length > LONGEST_NAME;
	return svg("g", { class: gone.has(node) ? "node gone" : "node" },
		svg("title", {}, `${node}${gone.has(node) ? " – gone" : ""}`),
		svg("rect", { x, y: y + 1, width: NODE_WIDTH, height: height - 2 }),
		svg("text", { x: x + 8, y: y + ROW / 2 + 4 },
			isLong ? `${node.slice(0, LONGEST_NAME - 1)}…` : node));
}
