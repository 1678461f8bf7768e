// The panel of events: tracks that started or ended, entered or left a zone, or crossed a line, of
// all cameras, newest last. They are those that the viewer keeps, of what is chosen, and newer ones as
// long as they are shown; of a viewer that keeps none, those that arrive while the panel is open.

import { copies } from "../export/addresses.js";
import { askFor, EVENT_TYPE, merged, momentOf, queryOf, wordsOf } from "../model/events.js";
import { byId, element, listen, setOptions, setText, svg } from "../ui/elements.js";
import { clock, dayAndClock, number } from "../ui/format.js";
import { LineList } from "./line_list.js";

const MOST_CAMERAS = 8;
const POLL_MS = 2000;
const LIVE_KEPT = 500;
const ROWS_KEPT = 1000;
const PAGE = 100; // rows in an answer to a first question
const LISTS = { camera: "all cameras", kind: "all events", zone: "all zones and lines" };
const CHOICES = [...Object.keys(LISTS), "since", "until"];

export class EventsPanel {
	constructor(system, watches) {
		this.visible = false; // set by the dock
		this.wasVisible = false;
		this.system = system;
		this.watches = watches;
		this.isKept = null; // whether the viewer keeps events; null until it has said so
		this.rows = []; // those that it keeps, else those that arrived
		this.fault = "";
		this.hasEarlier = false;
		this.asking = {}; // of the question whose answer is awaited
		this.receive = (message) => this.add(message);
		this.list = new LineList("event-lines", () => this.rows,
			(row) => "message" in row ? liveRow(row) : keptRow(row));
		listen("event-filters", "change", () => this.restart());
		listen("event-older", "click", () => this.ask(true));
		listen("event-dialog", "click", ({ target }) => target.id === "event-dialog" && target.close());
		system.on("streams", () => this.draw());
		system.on("hello", () => this.restart()); // of a viewer that may keep others
	}

	/** The query for what is chosen. */
	get query() {
		return queryOf(Object.fromEntries(CHOICES.map((name) => [name, byId(`event-${name}`).value])));
	}

	draw() {
		const { visible, isKept } = this;
		if (visible !== this.wasVisible) {
			this.wasVisible = visible;
			clearTimeout(this.timer);
			if (visible) this.ask();
		}
		const streams = this.system.streams.filter(({ type }) => type === EVENT_TYPE);
		const live = visible && isKept === false ? streams.slice(0, MOST_CAMERAS) : [];
		this.watches.watchMessages(live.map(({ key }) => key), this.receive);
		byId("event-lines").dataset.empty = isKept || live.length ? "No event yet."
			: "No node publishes events.";
		byId("event-filters").hidden = !isKept;
		byId("event-older").hidden = !isKept || !this.hasEarlier;
		byId("event-table").href = `events.csv?${this.query}`;
		setText(byId("event-words"), this.fault || (isKept === false
			? "While this is open: the viewer keeps none, --events-dir makes it." : ""));
		this.list.draw();
	}

	/** Add a row of one that arrived. */
	add(message) {
		const key = (this.rows.at(-1)?.key ?? 0) + 1;
		this.rows.push({ key, message, at: this.system.now });
		if (this.rows.length > LIVE_KEPT) this.rows.shift();
		this.list.drawSoon();
	}

	/** Ask for what is chosen now. */
	restart() {
		clearTimeout(this.timer);
		this.asking = {};
		if (this.isKept) this.rows = [];
		if (this.visible) this.ask();
	}

	/** Ask for older events, or for newer ones, again and again. */
	async ask(isForOlder = false) {
		const asking = this.asking = {};
		const [first] = this.isKept ? this.rows : [];
		const place = !first ? "" : isForOlder ? `before=${first.number}`
			: `most=${ROWS_KEPT}&after=${this.rows.at(-1).number}`;
		const answer = await askFor([this.query, place].filter(Boolean).join("&"));
		if (this.asking !== asking) return; // something else was chosen meanwhile
		this.take(answer, !first || isForOlder);
		clearTimeout(this.timer);
		if (this.visible && this.isKept !== false) this.timer = setTimeout(() => this.ask(), POLL_MS);
	}

	take({ kept = this.isKept, fault = "", events = [], choices }, isPage) {
		if (kept !== this.isKept) this.rows = [];
		this.isKept = kept;
		this.fault = fault.trim();
		if (isPage && !fault) this.hasEarlier = events.length >= PAGE;
		if (kept) this.rows = merged(this.rows, events);
		for (const [name, all] of choices ? Object.entries(LISTS) : []) {
			const list = byId(`event-${name}`);
			const found = new Set([...choices[name], list.value].filter(Boolean));
			setOptions(list, [["", all], ...[...found].map((each) => [each, each.replaceAll("_", " ")])]);
		}
		this.draw();
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
