// One picture of the large view: its canvas, the overlay's canvas above it, its text, and the
// pointer on it.

import { topicName } from "../model/streams.js";
import { element, resize, setData, setText } from "../ui/elements.js";
import { drawOverlay } from "../video/overlay.js";
import { gradientOf, Toner, valuesOf, valueText } from "../video/tone.js";
import { release } from "../video/watches.js";

const PIXELS_FROM_SCALE = 2; // from here on, pixels are seen as squares
const WHEEL_STEP = 0.0015;

export class Pane {
	/** `grid` is the PaneGrid that receives the pointer events of this pane. */
	constructor(stream, grid) {
		this.stream = stream;
		this.frames = null; // the CameraFrames that it shows
		this.seq = null;
		this.item = null;
		this.pixel = ""; // the value under the pointer
		this.toner = new Toner();
		this.probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
		this.picture = element("canvas", { class: "picture", "data-key": stream.key,
			"data-live": "false", role: "img", "aria-label": `${stream.camera} ${topicName(stream)}` });
		this.overlay = element("canvas", { class: "overlay", "aria-hidden": "true" });
		this.state = element("p", { class: "pane-state", role: "status" });
		this.badge = element("span");
		this.caption = element("b");
		this.value = element("output", { class: "pane-value" });
		this.behind = element("span", { class: "pane-behind" });
		this.apart = element("span", { class: "pane-apart",
			title: "how much later than the first camera's frame it was captured" });
		this.scale = element("p", { class: "pane-scale", hidden: true }, element("span"), element("i"),
			element("span"));
		this.surface = element("div", { class: "pane-surface" }, this.picture, this.overlay,
			element("p", { class: "pane-badge" }, element("i", { class: "lamp" }), this.badge),
		this.scale, this.state);
		this.element = element("figure", { class: "pane", "data-key": stream.key }, this.surface,
			element("figcaption", {}, this.caption, this.behind, this.apart, this.value));
		listenToPointer(this, grid);
	}

	/** The frame that it should show. */
	get frame() {
		return this.frames?.frame ?? null;
	}

	/** Make the canvases as large as the pane is. */
	fitToSurface() {
		const width = Math.max(1, Math.round(this.surface.clientWidth * devicePixelRatio));
		const height = Math.max(1, Math.round(this.surface.clientHeight * devicePixelRatio));
		for (const canvas of [this.picture, this.overlay]) resize(canvas, { width, height });
	}

	/** Show this pane's picture of the frame; without one, keep the previous picture, with a mark. */
	take() {
		const { frame } = this;
		const item = frame.items.get(this.stream.key);
		if (!item?.bitmap) return;
		if (this.item !== item) release(this.item);
		this.item = item;
		this.seq = frame.seq;
	}

	/**
	 * Draw the picture, and the overlay if it is of the same frame. `overlay` is that of drawOverlay;
	 * `pointer` is a point of the frame, or null; `tone` is {choice, isMeasured}, as Toner takes them.
	 */
	paint({ view, orientation, overlay, pointer, tone }) {
		const { width, height } = this.picture;
		const picture = this.picture.getContext("2d", { alpha: false });
		const marks = this.overlay.getContext("2d");
		picture.fillStyle = "#000";
		picture.fillRect(0, 0, width, height);
		marks.resetTransform();
		marks.clearRect(0, 0, width, height);
		marks.scale(devicePixelRatio, devicePixelRatio);
		if (!this.item) return;
		const { frame, frame: { header } } = this;
		const toCanvas = (point) => {
			const at = view.toPane(this.picture, orientation.toTurned(header, point));
			return { x: at.x / devicePixelRatio, y: at.y / devicePixelRatio };
		};
		const corner = view.toPane(this.picture, { x: 0, y: 0 });
		const toned = this.toner.toned(this.item, tone.choice, tone.isMeasured);
		picture.imageSmoothingEnabled = view.scale < PIXELS_FROM_SCALE;
		picture.imageSmoothingQuality = "medium"; // otherwise lines of one pixel break into dashes
		picture.setTransform(view.scale, 0, 0, view.scale, corner.x, corner.y);
		picture.transform(...orientation.transform(header));
		picture.drawImage(toned.image, 0, 0, header.width, header.height);
		picture.resetTransform();
		const drawn = this.seq === frame.seq
			? drawOverlay(marks, frame, overlay, toCanvas) : { marks: [], shapes: [] };
		if (pointer) drawSpot(marks, toCanvas(pointer));
		this.describe(view, overlay, drawn);
		this.writeScale(toned, tone.choice.map);
		this.pixel = pointer ? this.valueAt(pointer, header) : "";
		setText(this.value, this.pixel);
	}

	close() {
		release(this.item);
		this.item = null;
	}

	/** Describe what is drawn: in data attributes for styles, and as properties of the canvas. */
	describe(view, overlay, drawn) {
		const { frame } = this;
		const isJoined = overlay.keys.length > 0 && overlay.keys.every((key) => frame.items.has(key));
		const isBehind = this.seq !== frame.seq;
		setData(this.element, { step: !isBehind });
		setText(this.behind, isBehind ? `frame ${this.seq}, not ${frame.seq}` : "");
		setData(this.picture, { epoch: frame.epoch, seq: this.seq,
			overlay: isJoined ? "joined" : "without" });
		Object.assign(this.overlay, { drawn, view });
	}

	/** Show a scale of colours and values, unless a picture of 8 bits is shown unchanged. */
	writeScale({ isPlain, values, range }, map) {
		this.scale.hidden = isPlain && !values.isDepth;
		if (this.scale.hidden) return;
		const [low, bar, high] = this.scale.children;
		bar.style.background = gradientOf(values.isGrey ? map : "grey");
		setText(low, valueText(range.low, values.unit));
		setText(high, valueText(range.high, values.unit));
	}

	valueAt({ x, y }, header) {
		const { bitmap } = this.item;
		const column = Math.floor((x * bitmap.width) / header.width);
		const row = Math.floor((y * bitmap.height) / header.height);
		this.probe.clearRect(0, 0, 1, 1);
		this.probe.drawImage(bitmap, -column, -row);
		const [red, green, blue] = this.probe.getImageData(0, 0, 1, 1).data;
		const values = valuesOf(this.item.picture);
		if (values.isDepth) {
			const text = valueText(values.of(red, green, blue), values.unit);
			return values.isExact || text === "no reading" ? text : `about ${text}`;
		}
		return red === green && green === blue ? `${red}` : `R ${red}  G ${green}  B ${blue}`;
	}
}

/** A small square at the pointer: the same in each pane. */
function drawSpot(context, { x, y }) {
	context.lineWidth = 1;
	for (const { colour, half } of [{ colour: "#000", half: 6 }, { colour: "#fff", half: 5 }]) {
		context.strokeStyle = colour;
		context.strokeRect(x - half, y - half, 2 * half, 2 * half);
	}
}

/** Pass the events of mouse, pen and fingers on a pane to its grid, in device pixels of the pane. */
function listenToPointer(pane, grid) {
	const { surface } = pane;
	const down = new Map(); // id of a pointer -> its last point
	let editing = null; // id of the pointer that draws or moves a shape
	const pointOf = (event) => {
		const box = surface.getBoundingClientRect();
		return { x: (event.clientX - box.left) * devicePixelRatio,
			y: (event.clientY - box.top) * devicePixelRatio };
	};

	surface.addEventListener("pointerdown", (event) => {
		if (event.button > 0) return;
		surface.setPointerCapture(event.pointerId);
		if (!down.size && grid.press(pane, pointOf(event))) editing = event.pointerId;
		else down.set(event.pointerId, pointOf(event));
	});
	surface.addEventListener("pointermove", (event) => {
		const at = pointOf(event);
		grid.setPointer(pane, at);
		if (event.pointerId === editing) grid.editor.drag(grid.pointAt(pane, at));
		const before = down.get(event.pointerId);
		if (!before) return;
		down.set(event.pointerId, at);
		const others = [...down.values()].filter((point) => point !== at);
		if (others.length === 1) pinch(others[0], before, at);
		else grid.pan(at.x - before.x, at.y - before.y);
	});
	for (const name of ["pointerup", "pointercancel"]) {
		surface.addEventListener(name, (event) => {
			down.delete(event.pointerId);
			if (event.pointerId !== editing) return;
			editing = null;
			grid.editor.release();
		});
	}
	surface.addEventListener("pointerleave", (event) => {
		if (event.pointerType === "mouse") grid.setPointer(pane, null);
	});
	surface.addEventListener("wheel", (event) => {
		event.preventDefault();
		grid.zoom(Math.exp(-event.deltaY * WHEEL_STEP), pointOf(event));
	}, { passive: false });
	surface.addEventListener("dblclick", (event) => grid.toggleFit(pane, pointOf(event)));

	function pinch(other, before, at) {
		const distance = (point) => Math.max(1, Math.hypot(point.x - other.x, point.y - other.y));
		grid.zoom(distance(at) / distance(before), { x: (at.x + other.x) / 2, y: (at.y + other.y) / 2 });
		grid.pan((at.x - before.x) / 2, (at.y - before.y) / 2);
	}
}
