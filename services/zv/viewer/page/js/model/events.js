// Events of tracks: those that the viewer keeps, as rows, and what is said of one.

import { milliseconds } from "../transport/connection.js";
import { number } from "../ui/format.js";

export const EVENT_TYPE = "vision.TrackEvent.v1";
const LONGEST_TEXT = 60;

/**
 * The query of a request for events: fields of the address, and times in any form that Date knows.
 * @param {any} choice
 */
export function queryOf({ since, until, ...texts }) {
	const nanoseconds = (time) => (time ? `${new Date(time).getTime()}000000` : "");
	const given = { ...texts, since_ns: nanoseconds(since), until_ns: nanoseconds(until) };
	return new URLSearchParams(Object.entries(given).filter(([, value]) => value)).toString();
}

/** Ask the viewer for events: {kept, events, choices}, or {fault}, why there is no answer. */
export async function askFor(query) {
	const answer = await fetch(`events?${query}`).catch(() => null);
	if (answer?.ok) return answer.json();
	return { fault: answer ? await answer.text() : "The viewer does not answer." };
}

/** Merge events, newest first, into rows, oldest first, without those that are there already. */
export function merged(rows, events) {
	const found = new Map([...events.map(rowOf), ...rows].map((row) => [row.number, row]));
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

/** What happened, in words. */
export function wordsOf({ event, id, zone, direction, x, y, class: name }) {
	const place = Number.isFinite(x) && Number.isFinite(y) ? `at ${number(x, 0)}, ${number(y, 0)}` : "";
	const words = [`${String(event ?? "?").replaceAll("_", " ")} ${id ?? ""}`, name, zone, direction, place];
	return words.filter(Boolean).map((word) => String(word).slice(0, LONGEST_TEXT)).join(", ");
}
