// The numbers in a message, also in one of a schema that this page does not know.

import { own } from "./message_tree.js";

const MOST_FIELDS = 64;
const MOST_ITEMS = 16;
const DEEPEST = 4;

/**
 * Return the numbers of a message as a Map of names to values. Nested fields are joined by dots:
 * "box.2", "tracks.0.vx", "header.stamp_ns"; true and false are 1 and 0. A field that is not a number
 * now is left out, as is what is beyond 64 fields, 16 items of a list or 4 levels.
 */
export function numericFields({ header, body }) {
	const found = new Map();
	collect(found, "", body, 0);
	collect(found, "header.", header, 1);
	return found;
}

/** A number of a message by its name, also one beyond those limits; null if it is none. */
export function numberAt({ header, body }, name) {
	const names = name.split(".");
	return numberOf(names.reduce((value, one) => own(value, one), { ...body, header }), names.at(-1));
}

/** A value as a number, also an integer that the server sends as text for its size or its name. */
function numberOf(value, name) {
	if (Number.isFinite(value) || typeof value === "boolean") return Number(value);
	if (typeof value !== "string" || !/^-?\d{1,20}$/.test(value)) return null;
	const isSentAsText = name === "epoch" || name.endsWith("_ns")
		|| Math.abs(Number(value)) > Number.MAX_SAFE_INTEGER;
	return isSentAsText ? Number(value) : null;
}

/** Collect the numbers of fields; the items of a list have the name of their list. */
function collect(found, prefix, fields, depth, listName = "") {
	if (depth > DEEPEST || typeof fields !== "object" || fields === null) return;
	const entries = Object.entries(Array.isArray(fields) ? fields.slice(0, MOST_ITEMS) : fields);
	for (const [name, value] of entries) {
		if (found.size >= MOST_FIELDS) return;
		const own = listName || name;
		const number = numberOf(value, own);
		if (number !== null) found.set(prefix + name, number);
		else collect(found, `${prefix}${name}.`, value, depth + 1, Array.isArray(value) ? own : "");
	}
}
