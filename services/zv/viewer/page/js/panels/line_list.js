// A list of lines, newest last, which scrolls along only while its end is visible.

import { byId, drawList, later } from "../ui/elements.js";

const AT_END_PX = 24;
const DRAW_MS = 200; // one drawing for the lines of a busy system

export class LineList {
	/** `lines()` returns them, each with a `key`; `make(line)` makes the element of one. */
	constructor(id, lines, make) {
		this.list = byId(id);
		this.lines = lines;
		this.make = make;
		this.isClosed = true;
		this.drawSoon = later(() => this.draw(), DRAW_MS);
	}

	draw() {
		const { list, isClosed } = this;
		this.isClosed = !list.clientHeight;
		if (this.isClosed) return; // with its panel
		const atEnd = isClosed || list.scrollHeight - list.scrollTop - list.clientHeight < AT_END_PX;
		drawList(list, this.lines(), (line) => ({ element: this.make(line) }));
		if (atEnd) list.scrollTop = list.scrollHeight;
	}
}
