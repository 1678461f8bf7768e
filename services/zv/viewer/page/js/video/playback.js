// Pause and step: passes frames on or holds them back, and can show the last ones again.

import { between } from "../transport/connection.js";
import { decode, release } from "./watches.js";

const MOST_BYTES = 32_000_000;
const MOST_FRAMES = 300;

export class Playback {
	/** `display(frame, isNew)` shows a frame and owns its bitmaps. */
	constructor(display) {
		this.display = display;
		this.frames = []; // the last ones, not decoded, each with its `bytes`
		this.bytes = 0;
		this.paused = false;
		this.index = null; // of the frame that is shown while paused
		this.wantsOne = false; // to show one more, also while paused
	}

	setPaused(paused) {
		this.paused = paused;
		this.index = paused ? this.frames.length - 1 : null;
		this.wantsOne = false;
	}

	/** Whether no further frame is to be shown now. */
	get isHolding() {
		return this.paused && !this.wantsOne;
	}

	/** Whether the frame that is shown while paused is the last of those that are kept. */
	get isAtEnd() {
		return this.index >= this.frames.length - 1;
	}

	/** The header of the frame that is shown while paused; null without one. */
	get header() {
		return this.frames[this.index]?.header ?? null;
	}

	add(frame) {
		if (this.isHolding) {
			frame.items.forEach(release);
			return;
		}
		this.wantsOne = false;
		this.keep(frame);
		if (this.paused) this.index = this.frames.length - 1;
		this.display(frame, true);
	}

	/** Show the frame before (-1) or after (1) the current one, if it is kept. */
	step(by) {
		return this.show(this.index + by);
	}

	/** Show the frame whose stamp is nearest to that of a header. */
	showNearest({ stamp_ns: stamp }) {
		const away = this.frames.map(({ header }) => Math.abs(between(stamp, header.stamp_ns)));
		return this.show(away.lastIndexOf(Math.min(...away)));
	}

	async show(index) {
		if (index === this.index || !this.frames[index]) return;
		this.index = index;
		const kept = this.frames[index];
		const items = new Map(kept.items);
		for (const [key, { picture }] of items) {
			if (picture) items.set(key, { picture, bitmap: await decode(picture) });
		}
		if (this.paused && this.index === index) this.display({ ...kept, items }, false);
		else items.forEach(release);
	}

	/** Keep a frame's messages and the bytes of its pictures, but not its bitmaps. */
	keep(frame) {
		const items = new Map([...frame.items].map(([key, { bitmap, ...item }]) => [key, item]));
		const bytes = [...items.values()].reduce(
			(sum, { picture }) => sum + (picture?.data?.byteLength ?? 0), 0);
		this.frames.push({ ...frame, items, bytes });
		this.bytes += bytes;
		while (this.frames.length > 1
				&& (this.bytes > MOST_BYTES || this.frames.length > MOST_FRAMES)) {
			this.bytes -= this.frames.shift().bytes;
		}
	}
}
