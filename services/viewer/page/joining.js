// Which pictures and messages belong together: those of the same epoch and sequence number.
//
// One stream leads: the picture that is shown large. Two frame times after it came, it is released
// without the messages that did not; for pictures beside it, it waits longer; not at all for what
// cannot come any more, because that stream is further on or silent. Frames are released in order.
// A complete one goes before older ones that are not, and those are dropped.

import { between } from "./wire.js";

const PATIENCE_FRAMES = 2;
const PATIENCE_TOGETHER_FRAMES = 12; // where being of one frame matters more than being new
const FIRST_GUESS_MS = 50;
const SILENT_MS = 1000;
const INTERVALS = 15;
const FRAMES_KEPT = 128;

export class Joiner {
	/** @param discard called with each item that will never be released */
	constructor(discard = () => {}) {
		this.onlyComplete = false;
		this.discard = discard;
		this.follow([], [], 0);
	}

	/** Begin anew. The first of `pictures` leads; the others and `messages` are its parts. */
	follow(pictures, messages, now) {
		for (const frame of this.frames?.values() ?? []) this.drop(frame);
		this.lead = pictures[0] ?? null;
		this.hasOthers = pictures.length > 1;
		this.parts = new Map();
		for (const key of [...pictures.slice(1), ...messages]) {
			this.parts.set(key, { at: now, epoch: null, seq: -1, lag: null });
		}
		this.frames = new Map();
		this.arrivals = new Map();
		this.epoch = null;
		this.taken = -1;
		this.last = null;
		this.intervals = [];
	}

	/** Milliseconds from one captured frame to the next, as the stamps tell. */
	get frameTime() {
		if (!this.intervals.length) return FIRST_GUESS_MS;
		return [...this.intervals].sort((a, b) => a - b)[this.intervals.length >> 1];
	}

	lag(key) {
		return this.parts.get(key)?.lag ?? null;
	}

	offer(key, header, item, now) {
		if (key === this.lead) this.offerLead(header, item, now);
		else if (this.parts.has(key)) this.offerPart(key, header, item, now);
		else this.discard(item);
	}

	/** Return the next frame to show, or null: {epoch, seq, header, items, missing}. */
	take(now) {
		const waiting = this.waiting();
		const complete = waiting.filter((frame) => !this.missing(frame).length);
		const chosen = complete.at(-1) ?? waiting.filter((frame) => this.settled(frame, now)).at(-1);
		if (!chosen) return null;
		const missing = this.missing(chosen);
		this.frames.delete(chosen.id);
		this.forgetUpTo(chosen.seq);
		if (missing.length && this.onlyComplete) {
			this.drop(chosen);
			return null;
		}
		const { epoch, seq, header, items } = chosen;
		return { epoch, seq, header, items, missing };
	}

	/** When `take` should be asked again though nothing came; null if nothing waits. */
	due() {
		const oldest = this.waiting()[0];
		return oldest ? oldest.at + this.patience() : null;
	}

	offerLead(header, picture, now) {
		const { epoch, seq } = header;
		if (epoch !== this.epoch) this.beginEpoch(epoch);
		if (seq <= this.taken) {
			this.discard(picture);
			return;
		}
		this.measure(header);
		const frame = this.frame(header);
		this.put(frame, this.lead, picture);
		frame.header = header;
		frame.at = now;
		this.arrivals.set(frame.id, now);
		if (this.arrivals.size > FRAMES_KEPT) {
			this.arrivals.delete(this.arrivals.keys().next().value);
		}
	}

	offerPart(key, header, item, now) {
		const part = this.parts.get(key);
		const id = identity(header);
		Object.assign(part, { at: now, epoch: header.epoch, seq: header.seq });
		const arrival = this.arrivals.get(id);
		if (arrival !== undefined) part.lag = now - arrival;
		if (header.epoch === this.epoch && header.seq <= this.taken) this.discard(item);
		else this.put(this.frame(header), key, item);
	}

	beginEpoch(epoch) {
		this.epoch = epoch;
		this.taken = -1;
		this.last = null;
		for (const frame of [...this.frames.values()]) {
			if (frame.epoch !== epoch) this.forget(frame);
		}
	}

	measure(header) {
		if (this.last && header.seq > this.last.seq) {
			const frames = header.seq - this.last.seq;
			const each = between(this.last.stamp_ns, header.stamp_ns) / frames;
			if (each > 0) this.intervals.push(each);
			if (this.intervals.length > INTERVALS) this.intervals.shift();
		}
		this.last = header;
	}

	frame(header) {
		const id = identity(header);
		let frame = this.frames.get(id);
		if (!frame) {
			frame = { id, epoch: header.epoch, seq: header.seq, header, items: new Map(), at: null };
			this.frames.set(id, frame);
			if (this.frames.size > FRAMES_KEPT) this.forget(this.frames.values().next().value);
		}
		return frame;
	}

	put(frame, key, item) {
		if (frame.items.has(key)) this.discard(frame.items.get(key));
		frame.items.set(key, item);
	}

	/** Frames whose picture is here, oldest first. */
	waiting() {
		return [...this.frames.values()]
			.filter((frame) => frame.at !== null && frame.epoch === this.epoch)
			.sort((a, b) => a.seq - b.seq);
	}

	missing(frame) {
		return [...this.parts.keys()].filter((key) => !frame.items.has(key));
	}

	patience() {
		const isTogether = this.onlyComplete || this.hasOthers;
		return (isTogether ? PATIENCE_TOGETHER_FRAMES : PATIENCE_FRAMES) * this.frameTime;
	}

	/** Tell whether waiting longer for a frame's missing parts is over, or of no use. */
	settled(frame, now) {
		if (now - frame.at >= this.patience()) return true;
		return this.missing(frame).every((key) => !this.mayCome(key, frame, now));
	}

	mayCome(key, frame, now) {
		const part = this.parts.get(key);
		if (part.epoch === frame.epoch && part.seq > frame.seq) return false;
		return now - part.at <= Math.max(SILENT_MS, 3 * this.frameTime);
	}

	forgetUpTo(seq) {
		this.taken = seq;
		for (const frame of [...this.frames.values()]) {
			if (frame.epoch === this.epoch && frame.seq <= seq) this.forget(frame);
		}
	}

	forget(frame) {
		this.frames.delete(frame.id);
		this.drop(frame);
	}

	drop(frame) {
		for (const item of frame.items.values()) this.discard(item);
	}
}

export function identity(header) {
	return `${header.epoch}:${header.seq}`;
}
