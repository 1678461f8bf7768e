// All picture streams at once. Only tiles that can be seen are watched, in their own size, and
// together they get no more pictures a second than a small machine can make and a page decode.

import { byId, element, inPlace, say } from "./elements.js";
import { inOrder, RAW, streamName, topicName } from "./naming.js";
import { recall, remember } from "./preferences.js";
import { Tile } from "./tile.js";
import { milliseconds } from "./wire.js";

const PICTURES_PER_SECOND = 150;
const FASTEST_HZ = 30;
const SLOWEST_HZ = 4;
const TICK_MS = 250;
const LARGEST_TILE = 640;
const SMALLEST_TILE = 260;

export class Wall {
	constructor(system, watches, connection) {
		this.system = system;
		this.watches = watches;
		this.tiles = new Map();
		this.seen = new Set();
		this.open = false;
		this.list = byId("tiles");
		this.filter = byId("filter");
		this.hidden = new Set(recall("hiddenTopics", [RAW]));
		this.observer = new IntersectionObserver((entries) => this.look(entries),
			{ rootMargin: "64px" });
		new ResizeObserver(() => this.resize()).observe(this.list);
		this.filter.addEventListener("input", () => this.arrange());
		system.on("streams", () => this.arrange());
		connection.on("ended", ({ key, since_ns: since }) => {
			this.tiles.get(key)?.ended(milliseconds(since));
		});
		setInterval(() => this.tick(), TICK_MS);
	}

	show(visible) {
		this.open = visible;
		for (const key of this.seen) this.tiles.get(key)?.show(visible);
	}

	/** Move the focus among tiles: "ArrowLeft" and so on. Returns whether it did. */
	move(key) {
		const links = [...this.list.querySelectorAll("a")];
		if (!links.length) return false;
		const at = links.indexOf(document.activeElement);
		if (at < 0) {
			links[0].focus();
			return true;
		}
		const columns = getComputedStyle(this.list).gridTemplateColumns.split(" ").length;
		const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns }[key];
		links[at + step]?.focus();
		return true;
	}

	focus(key) {
		this.tiles.get(key)?.link.focus();
	}

	arrange() {
		const all = inOrder(this.system.streams);
		const words = this.filter.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
		const shown = all.filter((stream) => !this.hidden.has(topicName(stream))
			&& words.every((word) => `${streamName(stream)} ${stream.key}`.includes(word)));
		const keys = new Set(shown.map((stream) => stream.key));
		for (const [key, tile] of this.tiles) if (!keys.has(key)) this.remove(key, tile);
		inPlace(this.list, shown.map((stream) => this.tile(stream).element));
		this.chips(all);
		const cameras = new Set(shown.map((stream) => stream.camera)).size;
		say(byId("wall-count"), all.length
			? `${shown.length} of ${all.length} streams, ${cameras} camera${cameras === 1 ? "" : "s"}` : "");
		byId("wall-empty").hidden = all.length > 0;
		this.setSize();
		byId("wall-none").hidden = all.length === 0 || shown.length > 0;
	}

	tile(stream) {
		let tile = this.tiles.get(stream.key);
		if (tile) tile.update(stream);
		else {
			tile = new Tile(stream, this.watches, () => this.pace(), () => this.system.now);
			this.tiles.set(stream.key, tile);
			this.observer.observe(tile.element);
		}
		return tile;
	}

	remove(key, tile) {
		this.observer.unobserve(tile.element);
		this.seen.delete(key);
		this.tiles.delete(key);
		tile.close();
	}

	look(entries) {
		for (const { target, isIntersecting } of entries) {
			const tile = this.tiles.get(target.dataset.key);
			if (!tile) continue;
			if (isIntersecting) this.seen.add(tile.key);
			else this.seen.delete(tile.key);
			tile.show(isIntersecting && this.open);
		}
	}

	/** Least time between two pictures of one tile, ms: fewer each, the more are seen. */
	pace() {
		const each = PICTURES_PER_SECOND / Math.max(1, this.seen.size);
		return 1000 / Math.min(FASTEST_HZ * 1.5, Math.max(SLOWEST_HZ, each));
	}

	chips(all) {
		const counts = new Map();
		for (const stream of all) {
			counts.set(topicName(stream), (counts.get(topicName(stream)) ?? 0) + 1);
		}
		const state = JSON.stringify([[...counts], [...this.hidden]]);
		if (state === this.chipState) return;
		this.chipState = state;
		const focused = document.activeElement?.dataset?.topic;
		byId("topics").replaceChildren(...[...counts].map(([topic, count]) => element("button", {
			type: "button", class: "chip", "data-topic": topic,
			"aria-pressed": String(!this.hidden.has(topic)),
			title: `Show or hide all ${topic} streams`,
			onclick: () => this.toggle(topic),
		}, topic, element("small", {}, String(count)))));
		if (focused) byId("topics").querySelector(`[data-topic="${CSS.escape(focused)}"]`)?.focus();
	}

	toggle(topic) {
		if (this.hidden.has(topic)) this.hidden.delete(topic);
		else this.hidden.add(topic);
		remember("hiddenTopics", [...this.hidden]);
		this.arrange();
	}

	/** Make tiles as wide as they can be with all seen at once, but not tiny. */
	setSize() {
		const { clientWidth: width, clientHeight: height } = this.list;
		let size = SMALLEST_TILE;
		for (let columns = 1; columns <= this.tiles.size; columns += 1) {
			const each = Math.floor((width - 14 - 10 * columns) / columns);
			const rows = Math.ceil(this.tiles.size / columns);
			if (each > LARGEST_TILE || rows * (each * 0.75 + 40) + 14 > height) continue;
			size = Math.max(each, size);
			break;
		}
		this.list.style.setProperty("--tile", `${size}px`);
	}

	resize() {
		this.setSize();
		clearTimeout(this.resizeTimer);
		this.resizeTimer = setTimeout(() => {
			for (const tile of this.tiles.values()) tile.resize();
		}, 200);
	}

	tick() {
		if (!this.open) return;
		const now = performance.now();
		for (const tile of this.tiles.values()) tile.tick(now);
	}
}
