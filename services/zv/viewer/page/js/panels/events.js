// The panel of events: tracks that started or ended, entered or left a zone, or crossed a line, of
// all cameras, newest last. Only events that arrive while the panel is open are listed.

import { byId, element, syncViews } from "../ui/elements.js";
import { clock, number } from "../ui/format.js";

const TYPE = "vision.TrackEvent.v1";
const MOST_CAMERAS = 8;
const ROWS_KEPT = 500;
const LONGEST_TEXT = 60;
const AT_END_PX = 24;
const DRAW_MS = 200; // one drawing for the events of a busy scene

export class EventsPanel {
	constructor(system, watches) {
		Object.assign(this, { system, watches, rows: [], made: 0 });
		this.stops = new Map(); // key of a stream -> the function that ends its watch
		this.views = new Map();
		system.on("streams", () => this.draw());
	}

	draw() {
		const streams = this.visible ? this.system.streams.filter(({ type }) => type === TYPE) : [];
		const keys = streams.slice(0, MOST_CAMERAS).map(({ key }) => key);
		for (const [key, stop] of this.stops) {
			if (keys.includes(key)) continue;
			stop();
			this.stops.delete(key);
		}
		for (const key of keys) {
			if (this.stops.has(key)) continue;
			this.stops.set(key, this.watches.watchMessages(key, (message) => this.take(message)));
		}
		if (!this.visible) return;
		const list = byId("event-lines");
		list.dataset.empty = keys.length ? "No event yet." : "No node publishes events.";
		const atEnd = list.scrollHeight - list.scrollTop - list.clientHeight < AT_END_PX;
		syncViews(list, this.views, this.rows, ({ message, at }) => ({ element: makeRow(message, at) }));
		if (atEnd) list.scrollTop = list.scrollHeight;
	}

	take(message) {
		this.made += 1;
		this.rows.push({ key: this.made, message, at: this.system.now });
		if (this.rows.length > ROWS_KEPT) this.rows.shift();
		this.timer ??= setTimeout(() => {
			this.timer = null;
			this.draw();
		}, DRAW_MS);
	}
}

function makeRow({ key, header, body }, at) {
	const { event, id, zone, direction, x, y } = body;
	const place = Number.isFinite(x) && Number.isFinite(y) ? `at ${number(x, 0)}, ${number(y, 0)}` : "";
	const [, camera] = key.split("/");
	const words = [`${String(event ?? "?").replaceAll("_", " ")} ${id ?? ""}`, zone, direction, place];
	const title = header ? `frame ${header.seq}, epoch ${header.epoch}` : null;
	return element("li", { title }, element("time", {}, clock(at)), element("b", {}, camera),
		words.filter(Boolean).map((word) => String(word).slice(0, LONGEST_TEXT)).join(", "));
}
