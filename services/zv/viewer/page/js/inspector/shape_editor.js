// Draws and changes the tracker's zones and lines with the mouse. Each change is sent to the tracker
// at once; if it is refused, the reason is shown, and the shapes become those of the tracker again.

import { distance, freeName, readShapes, shapeAt, writeShapes } from "../model/shapes.js";
import { hasShapes } from "../model/streams.js";
import { byId, setText } from "../ui/elements.js";

const WORDS = {
	zones: "Click the corners; on the first or last one again to end. Esc: none.",
	lines: "Click the two ends. Who goes to the arrow's side crosses to the right.",
};

export class ShapeEditor {
	/** `changed()` is called when something is to be drawn again. */
	constructor(system, connection, changed) {
		Object.assign(this, { system, connection, changed, camera: null, isActive: false });
		this.clear();
		system.on("parameters nodes hello", () => this.read());
		for (const kind of ["zones", "lines"]) {
			byId(`add-${kind}`).addEventListener("click", () => this.begin(kind));
		}
		byId("shape-name").addEventListener("change", ({ target }) => this.rename(target.value.trim()));
		byId("shape-delete").addEventListener("click", () => this.remove());
	}

	/** The node whose parameters are the zones and lines of the camera, or undefined. */
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
		const { zones, lines, isActive, draft } = this;
		return { zones, lines, counts, chosen: isActive ? this.chosen : undefined, draft: draft?.points };
	}

	/** Show and edit the shapes of this camera; null ends it. */
	follow(camera) {
		if (!camera && this.isActive) this.toggle();
		this.system.show(hasShapes(this.system.streams, camera) ? ["parameters"] : [], "large");
		if (camera !== this.camera) {
			this.camera = camera;
			this.clear();
		}
		this.read();
	}

	clear() {
		Object.assign(this, { zones: [], lines: [], draft: null, choice: null, held: null });
	}

	/** Take the shapes of the tracker, unless one is being moved. */
	read() {
		if (this.held !== null) return;
		const parameters = this.system.parameters.get(this.node);
		for (const kind of ["zones", "lines"]) {
			this[kind] = readShapes(String(parameters?.get(kind)?.value ?? ""));
		}
		if (!this.canEdit) this.isActive = false;
		this.draw();
	}

	draw() {
		const { isActive, draft, chosen } = this;
		byId("shapes-button").disabled = !this.canEdit;
		byId("shapes-button").setAttribute("aria-pressed", String(isActive));
		byId("shapes-bar").hidden = !isActive;
		const name = byId("shape-name");
		name.disabled = byId("shape-delete").disabled = !chosen;
		if (document.activeElement !== name || !chosen) name.value = chosen?.name ?? "";
		setText(byId("shape-words"), draft ? WORDS[draft.kind]
			: chosen ? "Drag a corner to move it." : "Click a shape to choose it.");
		this.changed();
	}

	toggle() {
		this.isActive = !this.isActive && this.canEdit;
		Object.assign(this, { draft: null, choice: null });
		this.refuse("");
		this.draw();
	}

	/** Cancel the unfinished shape, else end the editing; returns whether there was either. */
	escape() {
		if (!this.isActive) return false;
		if (this.draft) this.draft = null;
		else this.toggle();
		this.draw();
		return true;
	}

	begin(kind) {
		Object.assign(this, { draft: { kind, points: [] }, choice: null });
		this.refuse("");
		this.draw();
	}

	/** Handle a press of the pointer at a point; returns whether the editor used it. */
	press(point, reach) {
		if (!this.isActive) return false;
		const at = point.map(Math.round);
		if (this.draft) this.add(at, reach);
		else {
			this.choice = shapeAt(this, point, reach);
			this.held = this.choice?.corner ?? null;
			this.moved = false;
		}
		this.draw();
		return Boolean(this.draft || this.choice);
	}

	add(at, reach) {
		const { kind, points } = this.draft;
		const isAgain = [points[0], points.at(-1)].map((end) => end && distance(end, at) <= reach);
		if (kind === "zones" && points.length > 2 && isAgain.includes(true)) this.finish();
		else if (!isAgain[1]) points.push(at);
		if (kind === "lines" && points.length === 2) this.finish();
	}

	finish() {
		const { kind, points } = this.draft;
		const name = freeName(kind.slice(0, -1), this[kind]);
		this[kind] = [...this[kind], { name, world: false, points }];
		Object.assign(this, { draft: null, choice: { kind, index: this[kind].length - 1 } });
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

	async send(kind) {
		const values = { [kind]: writeShapes(this[kind]) };
		const reply = await this.connection.request({ op: "set", node: this.node, values });
		// The refused text may be long; the reason is in the last brackets.
		this.refuse(reply.ok ? "" : /\((.*)\)$/s.exec(reply.error)?.[1] ?? reply.error);
		if (!reply.ok) this.read();
	}

	refuse(text) {
		byId("shape-refusal").hidden = !text;
		setText(byId("shape-refusal"), text);
	}
}
