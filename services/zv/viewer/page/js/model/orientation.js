// How the pictures of a camera are turned and mirrored on this page. Boxes, points and values keep
// the coordinates of the frame, which are those of the messages.

import { KeptChoices } from "../ui/preferences.js";

const TEXT = /^(0|90|180|270)(m?)$/;

/** Mirrored first, left to right, then turned clockwise by a number of quarters. */
export class Orientation {
	constructor(quarters = 0, mirrored = false) {
		this.quarters = quarters;
		this.mirrored = mirrored;
	}

	/** Return the orientation of a text such as "90" or "180m"; of any other, that of the frame. */
	static of(text) {
		const [, degrees, letter] = TEXT.exec(text) ?? [null, "0", ""];
		return new Orientation(Number(degrees) / 90, letter === "m");
	}

	get text() {
		return `${90 * this.quarters}${this.mirrored ? "m" : ""}`;
	}

	/** The orientation after a further quarter clockwise. */
	rotated() {
		return new Orientation((this.quarters + 1) % 4, this.mirrored);
	}

	/** The orientation after the shown picture was mirrored, left to right. */
	flipped() {
		return new Orientation((4 - this.quarters) % 4, !this.mirrored);
	}

	/** The size of a turned frame. */
	size({ width, height }) {
		return this.quarters % 2 ? { width: height, height: width } : { width, height };
	}

	/** The numbers of a canvas transform from a frame to the turned frame. */
	transform({ width, height }) {
		/** @type {any[]} */
		const turns = [[1, 0, 0, 1, 0, 0], [0, 1, -1, 0, height, 0], [-1, 0, 0, -1, width, height],
			[0, -1, 1, 0, 0, width]];
		const [a, b, c, d, e, f] = turns[this.quarters];
		return this.mirrored ? [-a, -b, c, d, e + a * width, f + b * width] : [a, b, c, d, e, f];
	}

	/** Where a point of a frame is in the turned frame. */
	toTurned(frame, { x, y }) {
		const [a, b, c, d, e, f] = this.transform(frame);
		return { x: a * x + c * y + e, y: b * x + d * y + f };
	}

	/** Where a point of the turned frame is in the frame. */
	toFrame(frame, { x, y }) {
		const [a, b, c, d, e, f] = this.transform(frame);
		return { x: a * (x - e) + b * (y - f), y: c * (x - e) + d * (y - f) };
	}
}

/** The orientation of each camera's pictures, kept in the browser. */
export class Orientations {
	texts = new KeptChoices("orientations");

	of(camera) {
		return Orientation.of(this.texts.get(camera) ?? "0");
	}

	set(camera, { text }) {
		this.texts.set(camera, text === "0" ? null : text);
	}
}
