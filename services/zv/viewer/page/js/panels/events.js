// The panel of events: tracks that started or ended, entered or left a zone, or crossed a line, of
// all cameras, newest last. They are those that the viewer keeps; of one that keeps none, those that
// arrive while the panel is open.

import { copies } from "../export/addresses.js";
import { byId, element, setText, svg } from "../ui/elements.js";
import { clock, dayAndClock, number } from "../ui/format.js";
import { KeptEvents, momentOf } from "./kept_events.js";
import { LineList } from "./line_list.js";

export const TYPE = "vision.TrackEvent.v1";
const MOST_CAMERAS = 8;
const ROWS_KEPT = 500;
const LONGEST_TEXT = 60;
const CHOSEN_BY = ["camera", "kind", "zone", "since", "until"];

export class EventsPanel {
	constructor(system, watches) {
		this.visible = false; // set by the dock
		this.system = system;
		this.watches = watches;
		this.rows = [];
		this.made = 0;
		this.stops = new Map(); // key of a stream -> the function that ends its watch
		const fields = Object.fromEntries(CHOSEN_BY.map((name) => [name, byId(`event-${name}`)]));
		this.kept = new KeptEvents(fields, () => this.draw());
		this.list = new LineList("event-lines", () => this.kept.isKept ? this.kept.rows : this.rows,
			(row) => "message" in row ? liveRow(row) : keptRow(row));
		byId("event-older").addEventListener("click", () => this.kept.ask(true));
		const dialog = byId("event-dialog");
		dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
		system.on("streams", () => this.draw());
		system.on("hello", () => this.kept.restart()); // of a viewer that may keep others
	}

	draw() {
		const { isKept, words, hasEarlier, query } = this.kept;
		this.kept.show(this.visible);
		const isLive = this.visible && isKept === false;
		const streams = this.system.streams.filter(({ type }) => isLive && type === TYPE);
		const wanted = streams.slice(0, MOST_CAMERAS).map(({ key }) => [key, (one) => this.take(one)]);
		this.watches.syncMessages(this.stops, new Map(wanted));
		byId("event-lines").dataset.empty = isKept || wanted.length ? "No event yet."
			: "No node publishes events.";
		byId("event-filters").hidden = !isKept;
		byId("event-older").hidden = !isKept || !hasEarlier;
		byId("event-table").href = `events.csv?${query}`;
		setText(byId("event-words"), words || (isKept === false
			? "While this is open: the viewer keeps none, --events-dir makes it." : ""));
		this.list.draw();
	}

	take(message) {
		this.made += 1;
		this.rows.push({ key: this.made, message, at: this.system.now });
		if (this.rows.length > ROWS_KEPT) this.rows.shift();
		this.list.drawSoon();
	}
}

function liveRow({ message: { key, header, body }, at }) {
	const [, camera] = key.split("/");
	const title = header ? `frame ${header.seq}, epoch ${header.epoch}` : null;
	return element("li", { title }, element("time", {}, clock(at)), element("b", {}, camera),
		wordsOf(body));
}

function keptRow(row) {
	const picture = row.picture === null ? null
		: element("img", { src: pictureOf(row), alt: "", loading: "lazy" });
	return element("li", {}, element("button", { type: "button", onclick: () => open(row) }, picture,
		element("span", {}, element("time", {}, dayAndClock(row.at)), element("b", {}, row.camera),
			wordsOf(row))));
}

/** What happened, in words. */
export function wordsOf({ event, id, zone, direction, x, y, class: name }) {
	const place = Number.isFinite(x) && Number.isFinite(y) ? `at ${number(x, 0)}, ${number(y, 0)}` : "";
	const words = [`${String(event ?? "?").replaceAll("_", " ")} ${id ?? ""}`, name, zone, direction, place];
	return words.filter(Boolean).map((word) => String(word).slice(0, LONGEST_TEXT)).join(", ");
}

/** A number may have another picture once the viewer has begun a new file. */
function pictureOf({ picture, at }) {
	return `events/${picture}.jpg?at=${at}`;
}

/** Show the picture of an event with the box of its track, and where it happened. */
function open(row) {
	const { width, height, box, x, y } = row;
	const shapes = [];
	if (row.picture !== null) shapes.push(svg("image", { href: pictureOf(row), width, height }));
	if (box) shapes.push(svg("rect", { x: box[0], y: box[1], width: box[2], height: box[3] }));
	if (Number.isFinite(x) && Number.isFinite(y)) {
		shapes.push(svg("circle", { cx: x, cy: y, r: Math.max(width, height) / 120 }));
	}
	const view = byId("event-view");
	view.setAttribute("viewBox", `0 0 ${width} ${height}`);
	view.replaceChildren(...shapes);
	setText(byId("event-title"), `${row.camera}: ${wordsOf(row)}`);
	setText(byId("event-about"), `${new Date(row.at).toLocaleString()}, ${momentOf(row)}`
		+ `${box ? "" : ", no box"}, frame ${row.seq}, epoch ${row.epoch}`);
	byId("event-recordings").replaceChildren();
	byId("event-dialog").showModal();
	showRecordings(row.number);
}

/** Show which recordings hold an event, each with the command that opens it there. */
async function showRecordings(event) {
	const place = byId("event-recordings");
	const asking = place.asking = {};
	const { recordings } = await fetch(`events/${event}/recordings`).then((said) => said.json())
		.catch(() => ({ recordings: [] }));
	if (place.asking !== asking) return; // another event was opened meanwhile
	place.replaceChildren(...recordings.map(({ file, at_s: at, command }) => {
		const field = element("input", { type: "text", readonly: true, value: command,
			 "aria-label": `Show ${file}` });
		const button = element("button", { type: "button" }, "Copy");
		copies(button, field);
		return element("p", {}, `In the recording ${file}, ${number(at, 1)} s after its begin:`,
			element("span", { class: "command" }, field, button));
	}));
}
