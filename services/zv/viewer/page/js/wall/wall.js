// All picture streams at once. Only visible tiles are watched, at their displayed size, and their
// total rate is limited to what a small machine can encode and a page can decode.

import { pictureStreams, RAW, STAGES, streamName, streamOf, topicName } from "../model/streams.js";
import { byId, drawList, element, listen, setData, setText } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";
import { Tile } from "./tile.js";

const PICTURES_PER_SECOND = 150;
const FASTEST_HZ = 30;
const SLOWEST_HZ = 4;
const TICK_MS = 250;
const LARGEST_TILE = 640;
const SMALLEST_TILE = 260;

export class Wall {
	/**
	 * `orientations` and `transfer` are the page's choices for the streams; `linkTo(key)` returns
	 * the fragment of the URL that shows a stream large.
	 */
	constructor(system, watches, { orientations, transfer }, linkTo) {
		this.system = system;
		this.watches = watches;
		this.orientations = orientations;
		this.transfer = transfer;
		this.linkTo = linkTo;
		this.open = false;
		this.chosen = []; // keys; none for all streams
		this.columns = null; // tiles in a row; null for as wide as possible
		this.tiles = new Map(); // key -> Tile
		this.list = byId("tiles");
		this.hidden = new Set(loadPreference("hiddenTopics", [RAW, ...STAGES]));
		this.observer = new IntersectionObserver((entries) => this.intersected(entries),
			{ rootMargin: "64px" });
		new ResizeObserver(() => this.setSize()).observe(this.list);
		listen("filter", "input", () => this.draw());
		system.on("streams", () => this.draw());
		setInterval(() => this.tick(), TICK_MS);
	}

	/** Show these streams in this order, or all if there are none, in so many columns; or nothing. */
	show(visible, { only, columns }) {
		this.open = visible;
		this.chosen = only;
		this.columns = columns;
		this.draw();
		for (const tile of this.tiles.values()) tile.show(visible && tile.isInView);
	}

	/** Whether the user hides a topic's streams; raw ones only beside their compressed version. */
	isHidden(stream, all) {
		return this.hidden.has(topicName(stream)) && (topicName(stream) !== RAW
			|| all.some((other) => other.key === `${stream.key}/compressed`));
	}

	/** Move the focus among tiles: "ArrowLeft" and so on. Returns whether it did. */
	move(key) {
		const links = [...this.list.querySelectorAll("a")];
		if (!links.length) return false;
		const at = links.findIndex((link) => link === document.activeElement);
		const columns = getComputedStyle(this.list).gridTemplateColumns.split(" ").length;
		const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns }[key];
		links[at < 0 ? 0 : at + step]?.focus();
		return true;
	}

	focus(key) {
		this.tiles.get(key)?.link.focus();
	}

	draw() {
		const all = pictureStreams(this.system.streams);
		const words = byId("filter").value.trim().toLowerCase().split(/\s+/).filter(Boolean);
		// Those of a layout, also those that do not exist, or all.
		const candidates = this.chosen.length
			? this.chosen.map((key) => all.find((one) => one.key === key) ?? streamOf(key))
			: all.filter((one) => !this.isHidden(one, all));
		const shown = candidates.filter((stream) =>
			words.every((word) => `${streamName(stream)} ${stream.key}`.toLowerCase().includes(word)));
		this.tiles = drawList(this.list, shown, (stream) => new Tile(stream, this), (tile) => tile.close());
		this.drawTopics(this.chosen.length ? [] : all);
		const cameras = new Set(shown.map((stream) => stream.camera)).size;
		setText(byId("wall-count"), all.length
			? `${shown.length} of ${all.length} streams, ${cameras} camera${cameras === 1 ? "" : "s"}` : "");
		const { misnamed } = this.system;
		setText(byId("wall-misnamed"), misnamed.length ? `Not shown: ${misnamed.join(", ")}. `
			+ "The name of a camera has only letters a-z, digits and _, such as cam_1." : "");
		byId("wall-empty").hidden = all.length > 0 || this.chosen.length > 0;
		byId("wall-none").hidden = shown.length > 0 || !byId("wall-empty").hidden;
		this.setSize();
	}

	intersected(entries) {
		for (const { target, isIntersecting } of entries) {
			const tile = this.tiles.get(target.dataset.key);
			if (!tile) continue;
			tile.isInView = isIntersecting;
			tile.show(isIntersecting && this.open);
		}
	}

	/** Minimum time between two pictures of a tile, ms: longer with more visible tiles. */
	pace() {
		const inView = [...this.tiles.values()].filter((tile) => tile.isInView).length;
		const each = PICTURES_PER_SECOND / Math.max(1, inView);
		return 1000 / Math.min(FASTEST_HZ * 1.5, Math.max(SLOWEST_HZ, each));
	}

	/** Write a button for each topic, which shows or hides its streams. */
	drawTopics(all) {
		const topics = all.map(topicName);
		const buttons = drawList(byId("topics"), [...new Set(topics)], (topic) => ({
			element: element("button", { type: "button", class: "chip",
				title: `Show or hide all ${topic} streams`, onclick: () => this.toggle(topic) },
			topic, element("small")),
		}));
		for (const [topic, { element: button }] of buttons) {
			button.setAttribute("aria-pressed", String(!this.hidden.has(topic)));
			setText(button.lastChild, String(topics.filter((other) => other === topic).length));
		}
	}

	toggle(topic) {
		if (!this.hidden.delete(topic)) this.hidden.add(topic);
		savePreference("hiddenTopics", [...this.hidden]);
		this.draw();
	}

	/** Make tiles as wide as possible with all of them visible, but not tiny. */
	setSize() {
		const { clientWidth: width, clientHeight: height } = this.list;
		this.list.style.setProperty("--columns", this.columns);
		setData(this.list, { arranged: this.columns !== null });
		const count = this.tiles.size;
		const sizes = Array.from({ length: count }, (_, index) => index + 1).map((columns) => ({
			rows: Math.ceil(count / columns), each: Math.floor((width - 14 - 10 * columns) / columns) }));
		const largest = sizes.find(({ rows, each }) => each <= LARGEST_TILE
			&& rows * (each * 0.75 + 40) + 14 <= height);
		this.list.style.setProperty("--tile", `${Math.max(SMALLEST_TILE, largest?.each ?? 0)}px`);
	}

	tick() {
		if (!this.open || document.hidden) return;
		const now = performance.now();
		for (const tile of this.tiles.values()) tile.resize();
		for (const tile of this.tiles.values()) tile.tick(now);
	}
}
