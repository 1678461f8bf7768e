// The panes of the large view: side by side, one zoom and one pointer for all, painted together.

import { byId, mark, say } from "./elements.js";
import { Pane } from "./pane.js";
import { listenToPointer } from "./pointing.js";
import { fit, panned, zoomed } from "./viewport.js";

const CAPTION_PX = 24;

export class PaneView {
	constructor() {
		this.panes = [];
		this.frame = null;
		this.mode = "fit"; // or "actual", or "free" as the user left it
		this.view = { scale: 1, x: 0, y: 0 };
		this.observer = new ResizeObserver(() => this.resized());
	}

	zoom(factor, at = undefined) {
		if (!this.frame) return;
		const { size } = this.panes[0];
		const middle = { x: size.width / 2, y: size.height / 2 };
		this.look("free", zoomed(this.view, this.frame.header, size, factor, at ?? middle));
	}

	/** Move the picture by device pixels; a whole frame stays where it is. */
	pan(dx, dy) {
		if (this.frame && this.mode !== "fit") {
			this.look("free", panned(this.view, this.frame.header, dx, dy));
		}
	}

	fit() {
		this.look("fit", this.view);
	}

	/** One pixel of the frame on one of the screen; `at`, of the frame, comes to the middle. */
	actual(at = this.view) {
		this.look("actual", { scale: 1, x: at.x, y: at.y });
	}

	look(mode, view) {
		Object.assign(this, { mode, view });
		mark(byId("panes"), "mode", mode);
		byId("fit").setAttribute("aria-pressed", String(mode === "fit"));
		byId("actual").setAttribute("aria-pressed", String(mode === "actual"));
		this.requestPaint();
	}

	setPanes(streams) {
		const kept = new Map(this.panes.map((pane) => [pane.key, pane]));
		this.panes = streams.map((stream) => kept.get(stream.key) ?? this.newPane(stream));
		for (const pane of kept.values()) {
			if (!this.panes.includes(pane)) {
				this.observer.unobserve(pane.surface);
				pane.close();
			}
		}
		byId("panes").replaceChildren(...this.panes.map((pane) => pane.element));
		mark(byId("panes"), "count", this.panes.length);
		this.resized();
	}

	newPane(stream) {
		const pane = new Pane(stream);
		this.observer.observe(pane.surface);
		listenToPointer(pane.surface, {
			moved: (at) => this.pointed(pane, at),
			dragged: (dx, dy) => this.pan(dx, dy),
			zoomed: (factor, at) => this.zoom(factor, at),
			doubled: (at) => (this.mode !== "fit" || !this.frame ? this.fit()
				: this.actual(pane.locate(this.view, at, this.frame.header) ?? undefined)),
		});
		return pane;
	}

	requestPaint() {
		this.painting ??= requestAnimationFrame(() => {
			this.painting = null;
			if (this.frame && this.panes.length) this.paint();
		});
	}

	paint() {
		const { header } = this.frame;
		if (this.mode === "fit") this.view = fit(header, this.panes[0].size);
		for (const pane of this.panes) {
			pane.paint(this.frame, this.view, this.overlay(pane), this.pointer);
		}
		const { pointer: point, view: { scale } } = this;
		const place = point ? `${Math.floor(point.x)}, ${Math.floor(point.y)}` : "–";
		const isAlone = point && this.panes.length === 1;
		say(byId("pixel"), isAlone ? `${place} = ${this.panes[0].value}` : place);
		say(byId("zoom"), `${scale >= 1 ? Number(scale.toFixed(2)) : Number(scale.toPrecision(2))}×`);
	}

	/** As many columns as make the pictures largest. */
	resized() {
		const { clientWidth: width, clientHeight: height } = byId("panes");
		const { header } = this.frame ?? { header: { width: 4, height: 3 } };
		const count = this.panes.length;
		const scale = (columns) => Math.min(width / columns / header.width,
			(height / Math.ceil(count / columns) - CAPTION_PX) / header.height);
		const columns = [1, 2, 3, 4].reduce((best, each) => (scale(each) > scale(best) ? each : best));
		byId("panes").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
		for (const pane of this.panes) pane.fitToSurface();
		this.requestPaint();
	}

	pointed(pane, at) {
		if (!this.frame) return;
		this.pointer = at && pane.locate(this.view, at, this.frame.header);
		this.requestPaint();
	}
}
