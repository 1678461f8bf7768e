// The panel of messages: the newest of a stream as a tree, live, with what its schema says of each
// field; a search, copy as JSON, and a click on a number plots it.

import { copyText } from "../export/addresses.js";
import { describe, rowsOf } from "../model/message_tree.js";
import { byId, drawList, element, later, listen, setOptions, setText } from "../ui/elements.js";
import { size } from "../ui/format.js";

const DRAW_MS = 250;
const ROWS = 300;
const INDENT_PX = 14;
const SCHEMA = /^[A-Za-z0-9_.-]{1,100}$/;
const MOST_SCHEMAS = 50;

/**
 * The panel; `current()` returns the camera in the large view, `plot(topic, name)` plots a number.
 */
export function messagePanel(system, connection, watches, current, plot) {
	const panel = { visible: false, draw }; // set by the dock
	const list = byId("message-stream");
	const drawSoon = later(drawRows, DRAW_MS);
	const toggled = new Set(); // keys of rows
	const schemas = new Map();
	/** @type {any} */
	let message = null;
	let isHeld = false;
	let most = ROWS;

	/** Follow the chosen stream while the panel is open. */
	function draw() {
		const { visible } = panel;
		if (visible) {
			const camera = current();
			const rank = (stream) => (stream.camera === camera ? 0 : 1);
			const order = system.streams.filter(({ kind }) => kind === "message")
				.sort((a, b) => rank(a) - rank(b));
			setOptions(list, order.map(({ key, camera: of, topic }) => [key, `${of} / ${topic}`]));
		}
		if (message && message.key !== list.value) {
			message = null;
			most = ROWS;
			toggled.clear();
		}
		watches.watchMessages(visible && list.value && !isHeld ? [list.value] : [], take);
		drawRows();
	}

	function take(newest) {
		message = newest;
		drawSoon();
	}

	/** The fields as they were sent, the header first; none without a message. */
	function fieldsOf() {
		const { header, body = {} } = message ?? {};
		return header ? { header, ...body } : body;
	}

	function drawRows() {
		if (!panel.visible) return;
		const query = byId("message-search").value;
		const { rows, left, isCut } = rowsOf(fieldsOf(), { toggled, query, most });
		const schema = message?.type ? schemaOf(message.type) : null;
		const described = rows.map((row) => ({ ...row, about: describe(schema, row.names) }));
		drawList(byId("message-rows"), described, makeRow);
		setText(byId("message-words"), wordsFor(rows.length, query));
		byId("message-more").hidden = !left;
		setText(byId("message-more"), `Show more of ${left}${isCut ? " or more" : ""} other fields`);
		byId("message-copy").disabled = !message;
	}

	function wordsFor(shown, query) {
		if (!system.streams.some(({ kind }) => kind === "message")) return "No stream of messages is here.";
		if (!message) return "No message yet.";
		if (message.bytes) {
			return `This message has ${size(message.bytes)}, too many to be shown here. `
				+ `zv topic echo ${message.key} shows it.`;
		}
		return shown || !query ? "" : "No field matches the search.";
	}

	function makeRow({ names, key }) {
		let shown;
		const name = element("span", { class: "field-name" });
		const value = element("button", { type: "button", class: "quiet field-value", onclick: () => {
			if (shown.canOpen && !toggled.delete(key)) toggled.add(key);
			if (shown.canOpen) drawRows();
			else if (shown.kind === "number") plot(message.key, names.join("."));
		} });
		const about = element("small", { class: "dim" });
		const line = element("li", {}, name, value, about);
		return {
			element: line,
			update: (row) => {
				shown = row;
				line.style.paddingLeft = `${14 + row.depth * INDENT_PX}px`;
				const sign = row.isOpen ? "▾ " : "▸ ";
				setText(name, row.name);
				setText(value, `${row.canOpen ? sign : ""}${row.text}`);
				value.dataset.kind = row.kind;
				value.disabled = !row.canOpen && row.kind !== "number";
				value.ariaExpanded = row.canOpen ? row.isOpen : null;
				value.ariaLabel = `${row.name}: ${row.text}${row.kind === "number" ? ", plot it" : ""}`;
				setText(about, row.about);
			},
		};
	}

	/** The schema of a type of message; null until the server has answered, or if there is none. */
	function schemaOf(type) {
		if (!schemas.has(type) && SCHEMA.test(type) && schemas.size < MOST_SCHEMAS) {
			schemas.set(type, null);
			fetch(`schema?name=${encodeURIComponent(type)}`)
				.then((answer) => (answer.ok ? answer.json() : null))
				.then((schema) => {
					schemas.set(type, schema);
					drawRows(); // the message may have been drawn without it
				}, () => null);
		}
		return schemas.get(type) ?? null;
	}

	/** Copy the message; where the browser forbids it, its field stays, selected, until it is left. */
	async function copy() {
		const field = byId("message-json");
		field.hidden = false;
		field.value = JSON.stringify(fieldsOf(), null, 2);
		field.hidden = await copyText(byId("message-copy"), field, "Copy as JSON");
	}

	listen("message-stream", "change", draw);
	listen("message-search", "input", drawRows);
	listen("message-hold", "click", ({ target }) => {
		isHeld = !isHeld; // the message that is shown, and the server sends no more
		target.ariaPressed = isHeld;
		draw();
	});
	listen("message-copy", "click", copy);
	listen("message-json", "blur", ({ target }) => target.hidden = true);
	listen("message-more", "click", () => {
		most += ROWS;
		drawRows();
	});
	system.on("streams", draw);
	connection.on("large", ({ key, bytes, header }) => {
		if (key === list.value) take({ key, header, body: {}, bytes });
	});
	return panel;
}
