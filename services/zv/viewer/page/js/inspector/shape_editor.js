// Draws and changes the tracker's zones, lines and regions with mouse or finger. Each change is sent
// to the tracker at once, with the text that it is based on: if another has changed that meanwhile, or
// the tracker refuses the new one, the reason is shown, and the shapes become those of the tracker
// again.

import { distance, freeName, KINDS, readShapes, shapeAt, writeShapes } from "../model/shapes.js";
import { hasShapes } from "../model/streams.js";
import { byId, listen, setData, setText } from "../ui/elements.js";

const CORNERS = "Click the corners; on the first or last one again to end. Esc: none.";
const ENDS = "Click the two ends. Who goes to the arrow's side crosses to the right.";
const MOST_UNDONE = 100;
const KIND_NAMES = Object.keys(KINDS);

export class ShapeEditor {
	/** `changed()` is called when something is to be drawn again. */
	constructor(system, connection, changed) {
		this.system = system;
		this.connection = connection;
		this.changed = changed;
		this.camera = null;
		this.isActive = false;
		this.sending = 0;
		this.draft = null; // {kind, points} of an unfinished shape
		this.choice = null; // {kind, index, corner}
		this.held = null; // the corner that is being moved
		this.moved = false;
		this.done = []; // own changes: {kind, before, after}, as texts
		this.base = {}; // kind -> the tracker's text that the shapes are, or a change is based on
		this.seen = {}; // kind -> the tracker's text that was read last
		system.on("parameters nodes hello", () => this.read());
		for (const kind of KIND_NAMES) listen(`add-${kind}`, "click", () => this.begin({ kind, points: [] }));
		listen("shape-undo", "click", () => this.undo());
		listen("shape-name", "change", ({ target }) => this.rename(target.value.trim()));
		listen("shape-delete", "click", () => this.remove());
	}

	/** The node whose parameters are the shapes of the camera, or undefined. */
	get node() {
		return this.system.nodes.find(({ node, cameras, alive }) => alive !== false
			&& cameras?.includes(this.camera) && this.system.parameters.get(node)?.has("zones"))?.node;
	}

	get canEdit() {
		return Boolean(this.node) && this.system.hello?.scope !== "view";
	}

	/** The chosen shape, or null. */
	get chosen() {
		const { kind, index } = this.choice ?? {};
		return this[kind]?.[index] ?? null;
	}

	/** Return the shapes to draw, with these counts; with corners only while they are edited. */
	marks(counts) {
		const shapes = Object.fromEntries(KIND_NAMES.map((kind) => [kind, this[kind]]));
		return { ...shapes, counts, chosen: this.isActive ? this.chosen : undefined,
			draft: this.draft?.points };
	}

	/** Show and edit the shapes of this camera; null ends it. */
	follow(camera) {
		if (!camera && this.isActive) this.toggle();
		this.system.show(hasShapes(this.system.streams, camera) ? ["parameters"] : [], "large");
		if (camera !== this.camera) {
			Object.assign(this, { camera, draft: null, choice: null, held: null, done: [], base: {}, seen: {} });
			for (const kind of KIND_NAMES) this[kind] = [];
		}
		this.read();
	}

	/** Take the shapes of the tracker where they are new, unless one is being moved or sent. */
	read() {
		if (this.held !== null || this.sending) return;
		const parameters = this.system.parameters.get(this.node);
		for (const kind of KIND_NAMES) {
			const text = String(parameters?.get(kind)?.value ?? "");
			if (text === this.seen[kind]) continue;
			this.seen[kind] = text;
			if (text === this.base[kind]) continue; // as sent from here
			const name = this.choice?.kind === kind ? this.chosen?.name : undefined;
			this.base[kind] = text;
			this[kind] = readShapes(text);
			if (name === undefined) continue;
			const index = this[kind].findIndex((shape) => shape.name === name);
			this.choice = index < 0 ? null : { kind, index, corner: null };
		}
		if (!this.canEdit) this.isActive = false;
		this.draw();
	}

	draw() {
		const { isActive, draft, chosen } = this;
		byId("shapes-button").disabled = !this.canEdit;
		byId("shapes-button").setAttribute("aria-pressed", String(isActive));
		byId("shapes-bar").hidden = !isActive;
		setData(byId("large"), { editing: isActive });
		const name = byId("shape-name");
		name.disabled = byId("shape-delete").disabled = !chosen;
		byId("shape-undo").disabled = !draft?.points.length && !this.done.length;
		if (document.activeElement !== name || !chosen) name.value = chosen?.name ?? "";
		setText(byId("shape-words"), draft ? (draft.kind === "lines" ? ENDS : CORNERS)
			: chosen ? "Drag a corner to move it, or use the arrow keys (Shift: 10 pixels)." : "Click a shape to choose it.");
		this.changed();
	}

	toggle() {
		this.isActive = !this.isActive && this.canEdit;
		this.begin(null);
	}

	/** Cancel the unfinished shape, else end the editing; returns whether there was either. */
	escape() {
		if (!this.isActive) return false;
		if (this.draft) this.begin(null);
		else this.toggle();
		return true;
	}

	/** Begin with a draft, or without one. */
	begin(draft) {
		this.draft = draft;
		this.choice = null;
		this.refuse("");
		this.draw();
	}

	/** Handle a press of the pointer at a point; returns whether the editor used it. */
	press(point, reach) {
		if (!this.isActive) return false;
		const at = point.map(Math.round);
		if (this.draft) this.add(this.draft, at, reach);
		else {
			this.choice = shapeAt(this, point, reach);
			this.held = this.choice?.corner ?? null;
			this.moved = false;
		}
		this.draw();
		return Boolean(this.draft || this.choice);
	}

	/** Add a corner to a draft; it ends at its second point, or at one of its ends again. */
	add({ kind, points }, at, reach) {
		const isAgain = [points[0], points.at(-1)].map((end) => end && distance(end, at) <= reach);
		if (kind !== "lines" && points.length > 2 && isAgain.includes(true)) this.finish(kind, points);
		else if (!isAgain[1]) points.push(at);
		if (kind === "lines" && points.length === 2) this.finish(kind, points);
	}

	finish(kind, points) {
		const name = freeName(kind, this[kind]);
		this[kind] = [...this[kind], { name, world: false, points }];
		this.draft = null;
		this.choice = { kind, index: this[kind].length - 1, corner: null };
		this.send(kind);
	}

	/** Move the held corner to a point of the frame. */
	drag(point) {
		if (this.held === null) return;
		this.chosen.points[this.held] = point.map(Math.round);
		this.moved = true;
		this.changed();
	}

	release() {
		if (this.held === null) return;
		this.held = null;
		if (this.moved) this.send(this.choice.kind);
		else this.read();
	}

	/** Move the chosen corner, else the chosen shape, by [x, y]; returns whether there is one. */
	nudge(by) {
		if (!this.isActive || !this.chosen || this.held !== null) return false;
		const { kind, corner } = this.choice;
		this.chosen.points = this.chosen.points.map((point, index) => [null, index].includes(corner)
			? point.map((value, axis) => Math.round(value + by[axis])) : point);
		this.send(kind);
		this.changed();
		return true;
	}

	rename(name) {
		if (!this.chosen || name === this.chosen.name) return;
		this.chosen.name = name;
		this.send(this.choice.kind);
	}

	remove() {
		if (!this.chosen) return;
		const { kind, index } = this.choice;
		this[kind] = this[kind].filter((_, other) => other !== index);
		this.choice = null;
		this.send(kind);
		this.draw();
	}

	/**
	 * Take back the last corner of an unfinished shape, else the last change of this page; what another
	 * has changed since is not overwritten. Returns whether shapes are edited.
	 */
	undo() {
		if (!this.isActive || this.held !== null) return this.isActive;
		if (this.draft) this.draft.points.pop();
		else if (this.done.length) {
			const { kind, before, after } = this.done.pop();
			if (this.base[kind] !== after) this.refuse(`${kind} was changed by another meanwhile`);
			else {
				this[kind] = readShapes(before);
				this.choice = null;
				this.send(kind, before, false);
			}
		}
		this.draw();
		return true;
	}

	async send(kind, text = writeShapes(this[kind]), isNew = true) {
		const before = this.base[kind] ?? "";
		const expected = { [kind]: before };
		const change = { kind, before, after: text };
		if (isNew) this.done = [...this.done.slice(1 - MOST_UNDONE), change];
		this.base[kind] = text; // of the next change
		this.sending += 1;
		const reply = await this.connection.request({ op: "set", node: this.node,
			values: { [kind]: text }, expected });
		this.sending -= 1;
		// The refused text may be long; the reason is in the last brackets.
		this.refuse(reply.ok ? "" : /\((.*)\)$/s.exec(reply.error)?.[1] ?? reply.error);
		if (!reply.ok) {
			this.base[kind] = this.seen[kind] = null;
			this.done = this.done.filter((one) => one !== change);
		}
		this.read();
	}

	refuse(text) {
		setText(byId("shape-refusal"), text);
	}
}
