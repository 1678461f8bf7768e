// The panes of the large view side by side: one zoom for all, one pointer for those of a camera,
// painted together.

import { streamName, topicName } from "../model/streams.js";
import { byId, drawList, setData, setText } from "../ui/elements.js";
import { Pane } from "./pane.js";

const CAPTION_PX = 24;
const LARGEST_SCALE = 64;
const REACH_PX = 9; // a shape within this distance of the pointer is selected

/**
 * Zoom and pan as arithmetic: device pixels per frame pixel, and the frame's point at the middle of
 * the pane. All sizes are {width, height}, all points {x, y}; the frame is the turned one.
 */
export class View {
	constructor(scale, x, y) {
		this.scale = scale;
		this.x = x;
		this.y = y;
	}

	/** The whole frame in the middle of the pane. */
	static fit(frame, pane) {
		const scale = Math.min(pane.width / frame.width, pane.height / frame.height);
		return new View(scale, frame.width / 2, frame.height / 2);
	}

	/** Where a point of the frame is in the pane, device pixels. */
	toPane(pane, point) {
		return { x: (point.x - this.x) * this.scale + pane.width / 2,
			y: (point.y - this.y) * this.scale + pane.height / 2 };
	}

	toFrame(pane, point) {
		return { x: (point.x - pane.width / 2) / this.scale + this.x,
			y: (point.y - pane.height / 2) / this.scale + this.y };
	}

	/** The view zoomed by a factor; the point of the frame under `at` (of the pane) stays there. */
	zoomed(frame, pane, factor, at) {
		const least = Math.min(View.fit(frame, pane).scale, 1) / 2;
		const scale = Math.min(LARGEST_SCALE, Math.max(least, this.scale * factor));
		const held = this.toFrame(pane, at);
		const x = held.x - (at.x - pane.width / 2) / scale;
		const y = held.y - (at.y - pane.height / 2) / scale;
		return View.inside(frame, scale, x, y);
	}

	panned(frame, dx, dy) {
		return View.inside(frame, this.scale, this.x - dx / this.scale, this.y - dy / this.scale);
	}

	/** A view with its middle inside the frame, so that the frame cannot be lost. */
	static inside({ width, height }, scale, x, y) {
		return new View(scale, Math.min(width, Math.max(0, x)), Math.min(height, Math.max(0, y)));
	}
}

export class PaneGrid {
	/**
	 * `orientationOf(camera)` is how its pictures are turned, `lookOf(pane)` returns its {overlay,
	 * tone}, as Pane takes them, `painted()` is called after each painting. The `editor` gets the
	 * pointer first.
	 */
	constructor({ orientationOf, lookOf, painted, editor }) {
		this.orientationOf = orientationOf;
		this.lookOf = lookOf;
		this.painted = painted;
		this.editor = editor;
		this.panes = []; // in their order; the first leads
		this.mode = "fit"; // or "actual", or "free" as the user left it
		this.view = new View(1, 0, 0); // of the leading pane
		this.pointer = null; // {camera, x, y}, a point of the camera's frame
		this.turned = null; // the orientation of the leading pane, as text
		new ResizeObserver(() => this.resized()).observe(byId("panes"));
	}

	/** The first pane, once it has a frame. */
	get lead() {
		return this.panes[0]?.frame ? this.panes[0] : null;
	}

	/** The size of a pane's frame as it is shown. */
	sizeOf({ stream, frame }) {
		return this.orientationOf(stream.camera).size(frame.header);
	}

	/** Zoom at a point of a pane, or at its middle. */
	zoom(factor, at = null) {
		if (!this.lead) return;
		const { picture } = this.lead;
		const held = at ?? { x: picture.width / 2, y: picture.height / 2 };
		this.setView("free", this.view.zoomed(this.sizeOf(this.lead), picture, factor, held));
	}

	/** Move the picture by device pixels; a whole frame stays where it is. */
	pan(dx, dy) {
		if (!this.lead || this.mode === "fit") return;
		this.setView("free", this.view.panned(this.sizeOf(this.lead), dx, dy));
	}

	/** Show the frames whole if the leading one was turned. */
	turnTo({ text }) {
		if (text === this.turned) return;
		this.turned = text;
		this.fit();
		this.resized();
	}

	fit() {
		this.setView("fit", this.view);
	}

	/**
	 * Show one frame pixel per screen pixel, with the frame's point `at` in the middle.
	 * @param {{ x: number, y: number }} at
	 */
	actual(at = this.view) {
		this.setView("actual", new View(1, at.x, at.y));
	}

	/** Show the pixel at a point of a pane one to one, or the whole frame again. */
	toggleFit(pane, at) {
		if (this.editor.isActive) return;
		const pixel = this.mode === "fit" && this.lead && pane.frame && this.pixelAt(pane, at);
		if (this.mode !== "fit" || !this.lead) this.fit();
		else if (!pixel) this.actual();
		else {
			const { x, y } = this.orientationOf(pane.stream.camera).toTurned(pane.frame.header, pixel);
			const [own, lead] = [this.sizeOf(pane), this.sizeOf(this.lead)];
			this.actual({ x: x * lead.width / own.width, y: y * lead.height / own.height });
		}
	}

	setView(mode, view) {
		this.mode = mode;
		this.view = view;
		setData(byId("panes"), { mode });
		byId("fit").setAttribute("aria-pressed", String(mode === "fit"));
		byId("actual").setAttribute("aria-pressed", String(mode === "actual"));
		this.requestPaint();
	}

	/** The view of a pane; that of a frame of another size shows the same share of it. */
	viewOf(pane) {
		const own = this.sizeOf(pane);
		if (this.mode === "fit" || !this.lead) return View.fit(own, pane.picture);
		const lead = this.sizeOf(this.lead);
		const by = this.mode === "actual" ? 1
			: View.fit(own, pane.picture).scale / View.fit(lead, pane.picture).scale;
		const { scale, x, y } = this.view;
		return new View(scale * by, x * own.width / lead.width, y * own.height / lead.height);
	}

	/** Show these streams; `framesOf(stream)` are the frames that its pane shows. */
	setPanes(streams, framesOf) {
		const panes = drawList(byId("panes"), streams, (stream) => new Pane(stream, this),
			(pane) => pane.close());
		this.panes = [...panes.values()];
		const isOne = new Set(streams.map(({ camera }) => camera)).size === 1;
		this.panes.forEach((pane, index) => {
			Object.assign(pane, { stream: streams[index], frames: framesOf(streams[index]) });
			setText(pane.caption, isOne ? topicName(pane.stream) : streamName(pane.stream));
		});
		setData(byId("panes"), { count: this.panes.length });
		this.resized();
	}

	requestPaint() {
		this.painting ??= requestAnimationFrame(() => {
			this.painting = null;
			this.paint();
		});
	}

	paint() {
		const shown = this.panes.filter((pane) => pane.frame);
		if (!shown.length) return;
		const { width, height } = this.sizeOf(shown[0]);
		if (this.shape !== `${width}x${height}`) this.resized();
		if (this.lead && this.mode === "fit") this.view = View.fit({ width, height }, this.lead.picture);
		const { pointer, view: { scale } } = this;
		for (const pane of shown) {
			const { camera } = pane.stream;
			pane.paint({ view: this.viewOf(pane), orientation: this.orientationOf(camera),
				pointer: pointer?.camera === camera ? pointer : null, ...this.lookOf(pane) });
		}
		const place = pointer ? `${Math.floor(pointer.x)}, ${Math.floor(pointer.y)}` : "–";
		const isAlone = pointer && this.panes.length === 1;
		setText(byId("pixel"), isAlone ? `${place} = ${this.panes[0].pixel}` : place);
		setText(byId("zoom"), `${Number(scale >= 1 ? scale.toFixed(2) : scale.toPrecision(2))}×`);
		this.painted();
	}

	/** Use the number of columns with which the pictures are largest. */
	resized() {
		const { clientWidth: width, clientHeight: height } = byId("panes");
		const first = this.panes.find((pane) => pane.frame);
		const frame = first ? this.sizeOf(first) : { width: 4, height: 3 };
		this.shape = `${frame.width}x${frame.height}`;
		const count = this.panes.length;
		const scale = (columns) => Math.min(width / columns / frame.width,
			(height / Math.ceil(count / columns) - CAPTION_PX) / frame.height);
		const columns = [1, 2, 3, 4].reduce((best, each) => (scale(each) > scale(best) ? each : best));
		byId("panes").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
		for (const pane of this.panes) pane.fitToSurface();
		this.requestPaint();
	}

	setPointer(pane, at) {
		if (!pane.frame) return;
		const pixel = at && this.pixelAt(pane, at);
		this.pointer = pixel && { ...pixel, camera: pane.stream.camera };
		this.requestPaint();
	}

	/** Pass an event of the pointer on a pane to the shape editor; returns whether it used it. */
	press(pane, at) {
		if (!this.lead || !pane.frame || pane.stream.camera !== this.lead.stream.camera) return false;
		const reach = REACH_PX * devicePixelRatio / this.viewOf(pane).scale;
		return this.editor.press(this.pointAt(pane, at), reach);
	}

	/** The point [x, y] of the frame at a point of a pane. */
	pointAt(pane, at) {
		const turned = this.viewOf(pane).toFrame(pane.picture, at);
		const { x, y } = this.orientationOf(pane.stream.camera).toFrame(pane.frame.header, turned);
		return [x, y];
	}

	/** The middle of the frame's pixel at a point of a pane, or null outside of the frame. */
	pixelAt(pane, at) {
		const { width, height } = pane.frame.header;
		const [x, y] = this.pointAt(pane, at);
		const isInside = x >= 0 && y >= 0 && x < width && y < height;
		return isInside ? { x: Math.floor(x) + 0.5, y: Math.floor(y) + 0.5 } : null;
	}
}
