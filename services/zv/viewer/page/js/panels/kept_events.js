// The events that the viewer keeps: those that are chosen, and newer ones as long as they are shown.

import { milliseconds } from "../transport/connection.js";
import { setOptions } from "../ui/elements.js";

const POLL_MS = 2000;
const ROWS_KEPT = 1000;
const CHOICES = { camera: "all cameras", kind: "all events", zone: "all zones and lines" };

/** The query of a request for events: `choice` has fields of the address, and times as Dates. */
export function queryOf({ since, until, ...texts }) {
	const times = { since_ns: since, until_ns: until };
	const given = [...Object.entries(texts), ...Object.entries(times).map(([name, time]) =>
		[name, time ? `${time.getTime()}000000` : ""])];
	return new URLSearchParams(given.filter(([, value]) => value)).toString();
}

/** Merge events, newest first, into rows, oldest first, without those that are there already. */
export function merged(rows, events) {
	const found = new Map(rows.map((row) => [row.number, row]));
	for (const event of events) {
		if (!found.has(event.number)) found.set(event.number, rowOf(event));
	}
	return [...found.values()].sort((one, other) => one.number - other.number);
}

function rowOf({ kind, track, stamp_ns: stamp, ...event }) {
	return { ...event, event: kind, id: track, key: `kept ${event.number}`, at: milliseconds(stamp) };
}

/** What a picture shows, by how many frames it is later than its event. */
export function momentOf({ picture, frames_later: later }) {
	if (picture === null) return "no picture";
	if (later === null) return "picture of another run of the camera";
	if (later === 0) return "picture of this frame";
	const count = Math.abs(later);
	return `picture ${count} ${count === 1 ? "frame" : "frames"} ${later > 0 ? "later" : "earlier"}`;
}

export class KeptEvents {
	/** `fields` are the controls by what they choose; `changed()` is called when rows or words do. */
	constructor(fields, changed) {
		this.fields = fields;
		this.changed = changed;
		this.rows = [];
		this.words = "";
		this.isKept = null;
		this.hasEarlier = false;
		for (const [name, field] of Object.entries(fields)) {
			if (name in CHOICES) setOptions(field, [["", CHOICES[name]]]);
			field.addEventListener("change", () => this.restart());
		}
	}

	get query() {
		const chosen = Object.entries(this.fields).map(([name, field]) =>
			[name, name in CHOICES ? field.value : field.value && new Date(field.value)]);
		return queryOf(Object.fromEntries(chosen));
	}

	/** Begin to ask, or stop. */
	show(isShown) {
		if (isShown === Boolean(this.isShown)) return;
		this.isShown = isShown;
		clearTimeout(this.timer);
		if (isShown) this.ask();
	}

	/** Ask for what is chosen now. */
	restart() {
		clearTimeout(this.timer);
		this.asking = null;
		this.rows = [];
		if (this.isShown) this.ask();
	}

	/** Ask for older events, or for newer ones, again and again. */
	async ask(isForOlder = false) {
		const asking = this.asking = {};
		const isFirst = !this.rows.length;
		const place = isFirst ? "" : isForOlder ? `before=${this.rows[0].number}`
			: `most=${ROWS_KEPT}&after=${this.rows.at(-1).number}`;
		const answer = await fetch(`events?${[this.query, place].filter(Boolean).join("&")}`)
			.then(async (said) => said.ok ? said.json() : { fault: await said.text() },
				() => ({ fault: "The viewer does not answer." }));
		if (this.asking !== asking) return; // something else was chosen meanwhile
		this.take(answer, isFirst || isForOlder);
		clearTimeout(this.timer);
		if (this.isShown && this.isKept !== false) this.timer = setTimeout(() => this.ask(), POLL_MS);
	}

	take({ kept = this.isKept, fault, events = [], choices }, isPage) {
		this.isKept = kept;
		this.words = fault.trim();
		if (isPage && !fault) this.hasEarlier = events.length >= 100;
		this.rows = merged(this.rows, events);
		for (const name of choices ? Object.keys(CHOICES) : []) {
			const { value } = this.fields[name];
			const found = new Set([...choices[name], ...(value ? [value] : [])]);
			setOptions(this.fields[name],
				[["", CHOICES[name]], ...[...found].map((each) => [each, each.replaceAll("_", " ")])]);
		}
		this.changed();
	}
}
