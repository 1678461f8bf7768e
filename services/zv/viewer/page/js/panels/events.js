// The panel of events: tracks that started or ended, entered or left a zone, or crossed a line, of
// all cameras, newest last. They are those that the viewer keeps, of what is chosen, and newer ones as
// long as they are shown; of a viewer that keeps none, those that arrive while the panel is open.

import { copies } from "../export/addresses.js";
import { askFor, EVENT_TYPE, merged, momentOf, queryOf, wordsOf } from "../model/events.js";
import { byId, element, listen, setOptions, setText, svg } from "../ui/elements.js";
import { clock, dayAndClock, number } from "../ui/format.js";
import { lineList } from "./dock.js";

const MOST_CAMERAS = 8;
const POLL_MS = 2000;
const LIVE_KEPT = 500;
const ROWS_KEPT = 1000;
const PAGE = 100; // rows in an answer to a first question
const LISTS = { camera: "all cameras", kind: "all events", zone: "all zones and lines" };
const CHOICES = [...Object.keys(LISTS), "since", "until"];

export function eventsPanel(system, watches) {
	const panel = { visible: false, draw }; // set by the dock
	let wasVisible = false;
	/** @type {boolean | null} */
	let isKept = null; // whether the viewer keeps events; null until it has said so
	/** @type {any[]} */
	let rows = []; // those that it keeps, else those that arrived
	let fault = "";
	let hasEarlier = false;
	let asking = {}; // of the question whose answer is awaited
	let timer;
	const list = lineList("event-lines", () => rows,
		(row) => "message" in row ? liveRow(row) : keptRow(row));
	const valueOf = (name) => byId(`event-${name}`).value;
	const query = () => queryOf(Object.fromEntries(CHOICES.map((name) => [name, valueOf(name)])));

	function draw() {
		const { visible } = panel;
		if (visible !== wasVisible) {
			wasVisible = visible;
			clearTimeout(timer);
			if (visible) ask();
		}
		const streams = system.streams.filter(({ type }) => type === EVENT_TYPE);
		const live = visible && isKept === false ? streams.slice(0, MOST_CAMERAS) : [];
		watches.watchMessages(live.map(({ key }) => key), add);
		byId("event-lines").dataset.empty = isKept || live.length ? "No event yet."
			: "No node publishes events.";
		byId("event-filters").hidden = !isKept;
		byId("event-older").hidden = !isKept || !hasEarlier;
		byId("event-table").href = `events.csv?${query()}`;
		setText(byId("event-words"), fault || (isKept === false
			? "While this is open: the viewer keeps none, --events-dir makes it." : ""));
		list.draw();
	}

	/** Add a row of one that arrived. */
	function add(message) {
		const key = (rows.at(-1)?.key ?? 0) + 1;
		rows.push({ key, message, at: system.now });
		if (rows.length > LIVE_KEPT) rows.shift();
		list.drawSoon();
	}

	/** Ask for what is chosen now. */
	function restart() {
		clearTimeout(timer);
		asking = {};
		if (isKept) rows = [];
		if (panel.visible) ask();
	}

	/** Ask for older events, or for newer ones, again and again. */
	async function ask(isForOlder = false) {
		const own = asking = {};
		const [first] = isKept ? rows : [];
		const place = !first ? "" : isForOlder ? `before=${first.number}`
			: `most=${ROWS_KEPT}&after=${rows.at(-1).number}`;
		const answer = await askFor([query(), place].filter(Boolean).join("&"));
		if (asking !== own) return; // something else was chosen meanwhile
		take(answer, !first || isForOlder);
		clearTimeout(timer);
		if (panel.visible && isKept !== false) timer = setTimeout(() => ask(), POLL_MS);
	}

	function take({ kept = isKept, fault: newFault = "", events = [], choices }, isPage) {
		if (kept !== isKept) rows = [];
		isKept = kept;
		fault = newFault.trim();
		if (isPage && !newFault) hasEarlier = events.length >= PAGE;
		if (kept) rows = merged(rows, events);
		for (const [name, all] of choices ? Object.entries(LISTS) : []) {
			const found = new Set([...choices[name], valueOf(name)].filter(Boolean));
			setOptions(byId(`event-${name}`),
				[["", all], ...[...found].map((each) => [each, each.replaceAll("_", " ")])]);
		}
		draw();
	}

	listen("event-filters", "change", restart);
	listen("event-older", "click", () => ask(true));
	listen("event-dialog", "click", ({ target }) => target.id === "event-dialog" && target.close());
	system.on("streams", draw);
	system.on("hello", restart); // of a viewer that may keep others
	return panel;
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
	const hasPlace = Number.isFinite(x) && Number.isFinite(y);
	const view = byId("event-view");
	view.setAttribute("viewBox", `0 0 ${width} ${height}`);
	view.replaceChildren(...[
		row.picture !== null && svg("image", { href: pictureOf(row), width, height }),
		box && svg("rect", { x: box[0], y: box[1], width: box[2], height: box[3] }),
		hasPlace && svg("circle", { cx: x, cy: y, r: Math.max(width, height) / 120 }),
	].filter(Boolean));
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
