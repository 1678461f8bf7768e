// The panes of the large view side by side: one zoom and one pointer for all, painted together.

import { Orientation } from "../model/orientation.js";
import { byId, setData, setText, syncViews } from "../ui/elements.js";
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
		Object.assign(this, { scale, x, y });
	}

	/** The whole frame in the middle of the pane. */
	static fit(frame, pane) {
		const scale = Math.min(pane.width / frame.width, pane.height / frame.height);
		return new View(scale, frame.width / 2, frame.height / 2);
	}

	/** Where a point of the frame is in the pane, device pixels. */
	toPane(pane, point) {
		return {
			x: (point.x - this.x) * this.scale + pane.width / 2,
			y: (point.y - this.y) * this.scale + pane.height / 2,
		};
	}

	toFrame(pane, point) {
		return {
			x: (point.x - pane.width / 2) / this.scale + this.x,
			y: (point.y - pane.height / 2) / this.scale + this.y,
		};
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
	constructor() {
		this.views = new Map(); // key -> Pane
		this.panes = []; // in their order
		this.frame = null;
		this.mode = "fit"; // or "actual", or "free" as the user left it
		this.view = new View(1, 0, 0);
		this.orientation = new Orientation();
		new ResizeObserver(() => this.resized()).observe(byId("panes"));
	}

	/** The size of the frame as it is shown. */
	get turnedSize() {
		return this.orientation.size(this.frame.header);
	}

	/** Zoom at a point of a pane, or at its middle. */
	zoom(factor, at = null) {
		if (!this.frame) return;
		const { size } = this.panes[0];
		const held = at ?? { x: size.width / 2, y: size.height / 2 };
		this.setView("free", this.view.zoomed(this.turnedSize, size, factor, held));
	}

	/** Move the picture by device pixels; a whole frame stays where it is. */
	pan(dx, dy) {
		if (this.frame && this.mode !== "fit") {
			this.setView("free", this.view.panned(this.turnedSize, dx, dy));
		}
	}

	/** Show the frame in another orientation, whole. */
	turn(orientation) {
		if (orientation.text === this.orientation.text) return;
		this.orientation = orientation;
		this.fit();
		this.resized();
	}

	fit() {
		this.setView("fit", this.view);
	}

	/** Show one frame pixel per screen pixel, with the frame's point `at` in the middle. */
	actual(at = this.view) {
		this.setView("actual", new View(1, at.x, at.y));
	}

	/** Show the pixel at a point of a pane one to one, or the whole frame again. */
	toggleFit(pane, at) {
		if (this.editor.isActive) return;
		if (this.mode !== "fit" || !this.frame) this.fit();
		else {
			const pixel = this.pixelAt(pane, at);
			this.actual(pixel ? this.orientation.toTurned(this.frame.header, pixel) : this.view);
		}
	}

	setView(mode, view) {
		Object.assign(this, { mode, view });
		setData(byId("panes"), { mode });
		byId("fit").setAttribute("aria-pressed", String(mode === "fit"));
		byId("actual").setAttribute("aria-pressed", String(mode === "actual"));
		this.requestPaint();
	}

	setPanes(streams) {
		syncViews(byId("panes"), this.views, streams, (stream) => new Pane(stream, this),
			(pane) => pane.close());
		this.panes = streams.map((stream) => this.views.get(stream.key));
		setData(byId("panes"), { count: this.panes.length });
		this.resized();
	}

	requestPaint() {
		this.painting ??= requestAnimationFrame(() => {
			this.painting = null;
			if (this.frame && this.panes.length) this.paint();
		});
	}

	paint() {
		if (this.mode === "fit") this.view = View.fit(this.turnedSize, this.panes[0].size);
		const { view, orientation, pointer } = this;
		for (const pane of this.panes) {
			const overlay = this.overlayOf(pane);
			pane.paint(this.frame, { view, orientation, overlay, pointer, tone: this.toneOf(pane) });
		}
		const { pointer: point, view: { scale } } = this;
		const place = point ? `${Math.floor(point.x)}, ${Math.floor(point.y)}` : "–";
		const isAlone = point && this.panes.length === 1;
		setText(byId("pixel"), isAlone ? `${place} = ${this.panes[0].pixel}` : place);
		setText(byId("zoom"), `${Number(scale >= 1 ? scale.toFixed(2) : scale.toPrecision(2))}×`);
	}

	/** The number of columns with which the pictures are largest. */
	resized() {
		const { clientWidth: width, clientHeight: height } = byId("panes");
		const frame = this.frame ? this.turnedSize : { width: 4, height: 3 };
		const count = this.panes.length;
		const scale = (columns) => Math.min(width / columns / frame.width,
			(height / Math.ceil(count / columns) - CAPTION_PX) / frame.height);
		const columns = [1, 2, 3, 4].reduce((best, each) => (scale(each) > scale(best) ? each : best));
		byId("panes").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
		for (const pane of this.panes) pane.fitToSurface();
		this.requestPaint();
	}

	setPointer(pane, at) {
		if (!this.frame) return;
		this.pointer = at && this.pixelAt(pane, at);
		this.requestPaint();
	}

	/** Pass an event of the pointer on a pane to the shape editor; returns whether it used it. */
	press(pane, at) {
		const reach = REACH_PX * devicePixelRatio / this.view.scale;
		return Boolean(this.frame) && this.editor.press(this.pointAt(pane, at), reach);
	}

	drag(pane, at) {
		this.editor.drag(this.pointAt(pane, at));
	}

	release() {
		this.editor.release();
	}

	/** The point [x, y] of the frame at a point of a pane. */
	pointAt(pane, at) {
		const { x, y } = this.orientation.toFrame(this.frame.header, this.view.toFrame(pane.size, at));
		return [x, y];
	}

	/** The middle of the frame's pixel at a point of a pane, or null outside of the frame. */
	pixelAt(pane, at) {
		const { width, height } = this.frame.header;
		const { x, y } = this.orientation.toFrame({ width, height }, this.view.toFrame(pane.size, at));
		const isInside = x >= 0 && y >= 0 && x < width && y < height;
		return isInside ? { x: Math.floor(x) + 0.5, y: Math.floor(y) + 0.5 } : null;
	}
}
