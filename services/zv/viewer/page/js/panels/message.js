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

export class MessagePanel {
	/** `current()` returns the camera in the large view; `plot(topic, name)` plots a number. */
	constructor(system, connection, watches, current, plot) {
		this.visible = false; // set by the dock
		this.system = system;
		this.watches = watches;
		this.current = current;
		this.plot = plot;
		/** @type {any} */
		this.message = null;
		this.isHeld = false;
		this.toggled = new Set();
		this.most = ROWS;
		this.receive = (message) => this.take(message);
		this.drawSoon = later(() => this.drawRows(), DRAW_MS);
		this.schemas = new Map();
		this.list = byId("message-stream");
		listen("message-stream", "change", () => this.draw());
		listen("message-search", "input", () => this.drawRows());
		listen("message-hold", "click", () => this.hold(!this.isHeld));
		listen("message-copy", "click", () => this.copy());
		listen("message-json", "blur", ({ target }) => target.hidden = true);
		listen("message-more", "click", () => {
			this.most += ROWS;
			this.drawRows();
		});
		system.on("streams", () => this.draw());
		connection.on("large", ({ key, bytes, header }) => {
			if (key === this.key) this.take({ key, header, body: {}, bytes });
		});
	}

	get key() {
		return this.list.value;
	}

	/** Follow the chosen stream while the panel is open. */
	draw() {
		const streams = this.system.streams.filter(({ kind }) => kind === "message");
		if (this.visible) {
			const camera = this.current();
			const rank = (stream) => (stream.camera === camera ? 0 : 1);
			const order = [...streams].sort((a, b) => rank(a) - rank(b));
			setOptions(this.list, order.map(({ key, camera: of, topic }) => [key, `${of} / ${topic}`]));
		}
		if (this.message && this.message.key !== this.key) {
			this.message = null;
			this.most = ROWS;
			this.toggled.clear();
		}
		const isFollowed = this.visible && this.key && !this.isHeld;
		this.watches.watchMessages(isFollowed ? [this.key] : [], this.receive);
		if (this.visible) this.drawRows();
	}

	take(message) {
		this.message = message;
		this.drawSoon();
	}

	/** Hold the message that is shown, and let the server send no more; or go on. */
	hold(isHeld) {
		this.isHeld = isHeld;
		byId("message-hold").setAttribute("aria-pressed", String(isHeld));
		this.draw();
	}

	/** The fields as they were sent, the header first; none without a message. */
	get fields() {
		const { header, body = {} } = this.message ?? {};
		return header ? { header, ...body } : body;
	}

	drawRows() {
		if (!this.visible) return;
		const { message } = this;
		const query = byId("message-search").value;
		const { toggled, most } = this;
		const { rows, left, isCut } = rowsOf(this.fields, { toggled, query, most });
		const schema = message?.type ? this.schemaOf(message.type) : null;
		const described = rows.map((row) => ({ ...row, about: schema ? describe(schema, row.names) : "" }));
		drawList(byId("message-rows"), described, (row) => this.makeRow(row));
		setText(byId("message-words"), this.words(rows.length, query));
		byId("message-more").hidden = !left;
		setText(byId("message-more"), `Show more of ${left}${isCut ? " or more" : ""} other fields`);
		byId("message-copy").disabled = !message;
	}

	words(shown, query) {
		const { message, system } = this;
		if (!system.streams.some(({ kind }) => kind === "message")) return "No stream of messages is here.";
		if (!message) return "No message yet.";
		if (message.bytes) {
			return `This message has ${size(message.bytes)}, too many to be shown here. `
				+ `zv topic echo ${message.key} shows it.`;
		}
		return shown || !query ? "" : "No field matches the search.";
	}

	makeRow({ names, key }) {
		let shown;
		const name = element("span", { class: "field-name" });
		const value = element("button", { type: "button", class: "quiet field-value", onclick: () => {
			if (shown.canOpen && !this.toggled.delete(key)) this.toggled.add(key);
			if (shown.canOpen) this.drawRows();
			else if (shown.kind === "number") this.plot(this.message.key, names.join("."));
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
	schemaOf(type) {
		if (!this.schemas.has(type) && SCHEMA.test(type) && this.schemas.size < MOST_SCHEMAS) {
			this.schemas.set(type, null);
			fetch(`schema?name=${encodeURIComponent(type)}`)
				.then((answer) => (answer.ok ? answer.json() : null))
				.then((schema) => {
					this.schemas.set(type, schema);
					this.drawRows(); // the message may have been drawn without it
				}, () => null);
		}
		return this.schemas.get(type) ?? null;
	}

	/** Copy the message; where the browser forbids it, its field stays, selected, until it is left. */
	async copy() {
		const field = byId("message-json");
		field.hidden = false;
		field.value = JSON.stringify(this.fields, null, 2);
		field.hidden = await copyText(byId("message-copy"), field, "Copy as JSON");
	}
}
