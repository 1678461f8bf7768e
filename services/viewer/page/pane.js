// One picture of the large view: its canvas, the overlay's canvas above it, and what it says.

import { element, mark, say } from "./elements.js";
import { topicName } from "./naming.js";
import { drawOverlay } from "./overlay.js";
import { release } from "./frames.js";
import { toFrame, toPane } from "./viewport.js";

const PIXELS_FROM_SCALE = 2; // from here on, pixels are seen as squares

export class Pane {
	constructor(stream) {
		this.key = stream.key;
		this.seq = null;
		this.item = null;
		this.probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
		this.picture = element("canvas", { class: "picture", "data-key": this.key,
			"data-live": "false", role: "img", "aria-label": `${stream.camera} ${topicName(stream)}` });
		this.overlay = element("canvas", { class: "overlay", "aria-hidden": "true" });
		this.state = element("p", { class: "pane-state", role: "status" });
		this._badge = element("p", { class: "pane-badge" }, element("i", { class: "lamp" }),
			element("span"));
		this._value = element("output", { class: "pane-value" });
		this.behind = element("span", { class: "pane-behind" });
		this.badge("", false);
		this.surface = element("div", { class: "pane-surface" }, this.picture, this.overlay,
			this._badge, this.state);
		this.element = element("figure", { class: "pane", "data-key": this.key }, this.surface,
			element("figcaption", {}, element("b", {}, topicName(stream)), this.behind, this._value));
	}

	get size() {
		return { width: this.picture.width, height: this.picture.height };
	}

	/** Make the canvases as large as the pane is. */
	fitToSurface() {
		const ratio = devicePixelRatio || 1;
		const width = Math.max(1, Math.round(this.surface.clientWidth * ratio));
		const height = Math.max(1, Math.round(this.surface.clientHeight * ratio));
		if (this.picture.width === width && this.picture.height === height) return;
		for (const canvas of [this.picture, this.overlay]) Object.assign(canvas, { width, height });
	}

	/** Take over this pane's picture of a frame; without one, the one before stays, marked. */
	take(frame) {
		const item = frame.items.get(this.key);
		if (item?.bitmap) {
			if (this.item !== item) release(this.item);
			this.item = item;
			this.seq = frame.seq;
		}
	}

	/** Draw picture and overlay of the same frame. `overlay` is {keys, trails}. */
	paint(frame, view, overlay, pointer) {
		const { width, height } = this.size;
		const ratio = devicePixelRatio || 1;
		const picture = this.picture.getContext("2d", { alpha: false });
		const marks = this.overlay.getContext("2d");
		picture.fillStyle = "#000";
		picture.fillRect(0, 0, width, height);
		marks.clearRect(0, 0, width, height);
		if (!this.item) return;
		const { header } = frame;
		const corner = toPane(view, this.size, { x: 0, y: 0 });
		picture.imageSmoothingEnabled = view.scale < PIXELS_FROM_SCALE;
		picture.drawImage(this.item.bitmap, corner.x, corner.y, header.width * view.scale,
			header.height * view.scale);
		const isSame = this.seq === frame.seq;
		const drawn = isSame
			? drawOverlay(marks, frame, overlay.keys, overlay.trails, view, this.size, ratio) : [];
		if (pointer) drawSpot(marks, toPane(view, this.size, pointer), 5 * ratio);
		this.tell(frame, view, overlay, drawn);
		this.point(pointer, header);
	}

	point(pointer, header) {
		this.value = pointer ? this.valueAt(pointer, header) : "";
		say(this._value, this.value);
	}

	/** The frame's point at a point of the surface, or null outside of the frame. */
	locate(view, at, header) {
		const { x, y } = toFrame(view, this.size, at);
		const inside = x >= 0 && y >= 0 && x < header.width && y < header.height;
		return inside ? { x: Math.floor(x) + 0.5, y: Math.floor(y) + 0.5 } : null;
	}

	judge(live, words) {
		mark(this.picture, "live", live);
		mark(this.element, "live", live);
		say(this.state, words);
		this.state.hidden = !words;
	}

	/** Say how many of the last frames had their messages; an empty text hides it. */
	badge(words, isWithout) {
		say(this._badge.lastElementChild, words);
		this._badge.hidden = !words;
		mark(this._badge, "without", isWithout);
	}

	close() {
		release(this.item);
		this.item = null;
		this.element.remove();
	}

	tell(frame, view, overlay, drawn) {
		const found = overlay.keys.filter((key) => frame.items.has(key)).length;
		const joined = !overlay.keys.length ? "off"
			: found === overlay.keys.length ? "joined" : found ? "partial" : "without";
		const isBehind = this.seq !== frame.seq;
		mark(this.element, "step", !isBehind);
		say(this.behind, isBehind ? `frame ${this.seq}, not ${frame.seq}` : "");
		mark(this.picture, "epoch", frame.epoch);
		mark(this.picture, "seq", this.seq);
		mark(this.picture, "overlay", joined);
		mark(this.overlay, "seq", frame.seq);
		mark(this.overlay, "boxes", JSON.stringify(drawn));
		mark(this.overlay, "view", `${view.scale} ${view.x} ${view.y}`);
	}

	valueAt({ x, y }, header) {
		const { bitmap } = this.item;
		const column = Math.floor((x * bitmap.width) / header.width);
		const row = Math.floor((y * bitmap.height) / header.height);
		this.probe.clearRect(0, 0, 1, 1);
		this.probe.drawImage(bitmap, -column, -row);
		const [red, green, blue] = this.probe.getImageData(0, 0, 1, 1).data;
		return red === green && green === blue ? `${red}` : `R ${red}  G ${green}  B ${blue}`;
	}
}

/** A small square at the pointer's place: the same in each pane. */
function drawSpot(context, { x, y }, half) {
	context.lineWidth = 1;
	for (const [colour, by] of [["#000", half + 1], ["#fff", half]]) {
		context.strokeStyle = colour;
		context.strokeRect(x - by, y - by, 2 * by, 2 * by);
	}
}
