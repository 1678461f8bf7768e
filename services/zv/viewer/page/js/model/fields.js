// The numbers in a message, also in one of a schema that this page does not know.

const MOST_FIELDS = 64;
const MOST_ITEMS = 16;
const DEEPEST = 4;

/**
 * Return the numbers of a message as a Map of names to values. Nested fields are joined by dots:
 * "box.2", "tracks.0.vx", "header.seq"; true and false are 1 and 0. A field that is not a number
 * now is left out, as is what is beyond 64 fields, 16 items of a list or 4 levels.
 */
export function numericFields({ header, body }) {
	const found = new Map();
	collect(found, "", body, 0);
	collect(found, "header.", header, 1);
	return found;
}

function collect(found, prefix, fields, depth) {
	if (depth > DEEPEST || typeof fields !== "object" || fields === null) return;
	const entries = Array.isArray(fields)
		? fields.slice(0, MOST_ITEMS).map((value, index) => [index, value]) : Object.entries(fields);
	for (const [name, value] of entries) {
		if (found.size >= MOST_FIELDS) return;
		const isNumber = Number.isFinite(value) || typeof value === "boolean";
		if (isNumber) found.set(prefix + name, Number(value));
		else collect(found, `${prefix}${name}.`, value, depth + 1);
	}
}
