// Pause and step: frames that come are shown, or kept back; those that were shown can come again.

import { decode } from "./decoding.js";
import { release } from "./frames.js";

const MOST_BYTES = 32_000_000;
const MOST_FRAMES = 300;

export class Playback {
	/** `display(frame, isNew)` shows a frame and owns its bitmaps. */
	constructor(display) {
		this.display = display;
		this.recent = new RecentFrames();
		this.reset();
	}

	reset() {
		this.recent.clear();
		this.paused = false;
		this.index = null;
		this.wantsOne = false;
	}

	arrived(frame) {
		if (this.paused && !this.wantsOne) {
			for (const item of frame.items.values()) release(item);
			return;
		}
		this.wantsOne = false;
		this.recent.add(frame);
		if (this.paused) this.index = this.recent.frames.length - 1;
		this.display(frame, true);
	}

	toggle() {
		this.paused = !this.paused;
		this.index = this.paused ? this.recent.frames.length - 1 : null;
		this.wantsOne = false;
	}

	/** Show the frame before (-1) or after (1) the one that stands; past the newest, the next. */
	async step(by) {
		const index = this.index + by;
		if (index < 0) return;
		if (index >= this.recent.frames.length) {
			this.wantsOne = true;
			return;
		}
		this.index = index;
		const kept = this.recent.frames[index];
		const items = new Map(kept.items);
		for (const [key, item] of items) {
			if (!item?.picture) continue;
			items.set(key, { picture: item.picture, bitmap: await decode(item.picture) });
		}
		if (this.paused && this.index === index) this.display({ ...kept, items }, false);
		else for (const item of items.values()) release(item);
	}
}

/** The last frames as they came, undecoded. */
class RecentFrames {
	constructor() {
		this.clear();
	}

	clear() {
		this.frames = [];
		this.bytes = 0;
	}

	/** Keep a joined frame: its pictures' bytes and its messages, not its bitmaps. */
	add(frame) {
		const items = new Map();
		let bytes = 0;
		for (const [key, item] of frame.items) {
			const isPicture = item?.bitmap !== undefined;
			items.set(key, isPicture ? { picture: item.picture } : item);
			if (isPicture) bytes += item.picture.data.byteLength;
		}
		this.frames.push({ ...frame, items, bytes });
		this.bytes += bytes;
		while (this.frames.length > 1
				&& (this.bytes > MOST_BYTES || this.frames.length > MOST_FRAMES)) {
			this.bytes -= this.frames.shift().bytes;
		}
	}
}
