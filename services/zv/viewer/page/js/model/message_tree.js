// A message as rows of a tree: any fields of any program, cut where they are long, and said to be.

const LONGEST_TEXT = 200;
const MOST_VISITED = 20_000; // fields that are looked at for one drawing
const OPEN_AT_FIRST = 20; // a map or list of the first level with more items is closed at first
const SEPARATOR = "\u0000"; // between the names in the key of a row

/**
 * Return {rows, left}: at most `most` rows {key, names, depth, name, text, kind, canOpen, isOpen},
 * and how many more there are. `toggled` has the keys of rows that are not as at first. With a
 * `query`, only the fields whose name or value contains it are shown, with what they are in.
 */
export function rowsOf(fields, { toggled, query = "", most }) {
	const search = query.trim().toLowerCase();
	/** @type {any} */
	const found = { rows: [], left: 0, visited: 0 };
	add(found, fields, [], { toggled, search, most });
	return { rows: found.rows, left: found.left, isCut: found.visited >= MOST_VISITED };
}

/** Add the rows of the items of a map or list; returns whether any was added or counted. */
function add(found, fields, names, options) {
	let isAny = false;
	for (const [name, value] of Object.entries(fields)) {
		if (found.visited >= MOST_VISITED) return isAny;
		found.visited += 1;
		const row = rowOf(value, [...names, name], options);
		const at = found.rows.length;
		const before = found.left;
		if (at < options.most) found.rows.push(row);
		else found.left += 1;
		const isInside = row.isOpen && add(found, value, row.names, options);
		if (!options.search || isInside || matches(row, options.search)) isAny = true;
		else {
			found.rows.length = at;
			found.left = before;
		}
	}
	return isAny;
}

function matches({ name, text, canOpen }, search) {
	return name.toLowerCase().includes(search) || (!canOpen && text.toLowerCase().includes(search));
}

function rowOf(value, names, { toggled, search }) {
	const key = names.join(SEPARATOR);
	const canOpen = typeof value === "object" && value !== null;
	const isList = Array.isArray(value);
	const count = canOpen ? Object.keys(value).length : 0;
	const items = `${count} ${count === 1 ? "item" : "items"}`;
	const isOpenAtFirst = names.length === 1 && count <= OPEN_AT_FIRST;
	return {
		key, names, depth: names.length - 1, name: names.at(-1), canOpen,
		isOpen: canOpen && (search !== "" || isOpenAtFirst !== toggled.has(key)),
		...(!canOpen ? leaf(value)
			: isList ? { kind: "list", text: `[${items}]` } : { kind: "map", text: `{${items}}` }),
	};
}

/** A value that has no items: {kind, text}. */
function leaf(value) {
	if (["number", "boolean"].includes(typeof value)) return { kind: "number", text: String(value) };
	if (typeof value !== "string") return { kind: "none", text: String(value) };
	// The server sends integers as text that JavaScript cannot represent, and all times.
	if (/^-?\d{10,20}$/.test(value)) return { kind: "number", text: value };
	if (value.length <= LONGEST_TEXT) return { kind: "text", text: JSON.stringify(value) };
	return { kind: "text", text: `${JSON.stringify(value.slice(0, LONGEST_TEXT))} … `
		+ `(cut, ${value.length} characters)` };
}

/** Return what a JSON Schema says of a field, by its names; empty if it says nothing. */
export function describe(schema, names) {
	let part = schema;
	for (const name of names) {
		part = resolved(schema, part);
		const properties = own(part, "properties");
		part = /^\d+$/.test(name) && !properties
			? own(part, "prefixItems")?.[Number(name)] ?? own(part, "items")
			: own(properties, name) ?? own(part, "additionalProperties");
		if (typeof part !== "object" || part === null) return "";
	}
	const text = own(part, "description") ?? own(resolved(schema, part), "description");
	return typeof text === "string" ? text.replace(/\n.*/s, "").slice(0, LONGEST_TEXT) : "";
}

/** A property of its own, not one that every object has, such as "constructor". */
export function own(value, name) {
	return typeof value === "object" && value !== null && Object.hasOwn(value, name)
		? value[name] : undefined;
}

/** The schema that a part refers to, or the one of its alternatives that is not null. */
function resolved(schema, part) {
	let found = part;
	for (let steps = 0; steps < 4; steps += 1) {
		const reference = own(found, "$ref");
		const either = own(found, "anyOf");
		if (typeof reference === "string") {
			found = own(own(schema, "$defs"), reference.split("/").at(-1));
		} else if (Array.isArray(either)) {
			found = either.find((one) => own(one, "type") !== "null");
		} else {
			return found;
		}
	}
	return found;
}
