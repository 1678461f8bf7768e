// Joins the pictures and messages of one camera that have the same epoch and sequence number into
// frames.
//
// The first picture stream leads. A frame is complete when all its parts have arrived. Two frame
// times after the arrival of its leading picture, it is released without the missing messages. It
// waits longer for the pictures of other streams, and not at all for parts that can no longer
// arrive because their stream has sent a later part or is silent. Frames are released in order. A
// complete frame is released before older incomplete ones, which are dropped.

import { longestSilence, median } from "../model/streams.js";
import { between } from "../transport/connection.js";

const PATIENCE_FRAMES = 2;
const PATIENCE_TOGETHER_FRAMES = 12; // if showing the same frame matters more than a low delay
const FIRST_GUESS_MS = 50;
const INTERVALS = 15;
const FRAMES_KEPT = 128;
const EARLY_KEPT = 16; // frames of which the leading picture has not come: each may take 8 MB
const APART_MS = 2000;

export class FrameJoiner {
	/**
	 * The first of `pictures` leads; the others and `messages` are its parts. `discard(item)` is called
	 * for each item that will never be released.
	 */
	constructor(pictures, messages, discard, now, onlyComplete = false) {
		this.onlyComplete = onlyComplete;
		this.discard = discard;
		this.frames = new Map(); // id -> {id, epoch, seq, header, items, at}, `at` with its picture
		this.pictures = pictures;
		this.togetherAt = now; // when a frame with all pictures was last taken
		this.parts = new Map([...pictures.slice(1), ...messages].map((key) =>
			[key, { at: now, epoch: null, seq: -1, lag: null, apartSince: null }]));
		this.arrivals = new Map(); // id of a frame -> when its leading picture came
		this.epoch = null;
		this.taken = -1;
		this.last = null;
		this.intervals = [];
	}

	/** Milliseconds from one captured frame to the next, by their stamps. */
	get frameTime() {
		return median(this.intervals) ?? FIRST_GUESS_MS;
	}

	/** Delay of the newest message of a stream after its picture, ms, or null. */
	lag(key) {
		return this.parts.get(key)?.lag ?? null;
	}

	/** Put an item that arrived at `now` into its frame, or discard it. */
	offer(key, header, item, now) {
		const { epoch, seq } = header;
		const id = `${epoch}:${seq}`;
		const isLead = key === this.pictures[0];
		const part = this.parts.get(key);
		// The server sends the pictures of a stream in order, so a lower number is a valid restart.
		if (isLead && (epoch !== this.epoch || seq < this.taken)) {
			if (epoch !== this.epoch) for (const each of this.parts.values()) each.apartSince = null;
			this.epoch = epoch;
			this.taken = -1;
			this.last = null;
			this.drop((frame) => frame.epoch !== epoch || frame.seq > seq);
		}
		if (part) {
			const arrival = this.arrivals.get(id);
			const lag = arrival === undefined ? part.lag : now - arrival;
			const apartSince = [epoch, null].includes(this.epoch) ? null : part.apartSince ?? now;
			Object.assign(part, { at: now, epoch, seq, lag, apartSince });
		}
		const isTooLate = epoch === this.epoch && seq <= this.taken;
		if (isTooLate || (!isLead && !part)) {
			this.discard(item);
			return;
		}
		const frame = this.frames.get(id) ?? { id, epoch, seq, header, items: new Map(), at: null };
		if (frame.items.has(key)) this.discard(frame.items.get(key));
		frame.items.set(key, item);
		this.frames.set(id, frame);
		if (isLead) {
			this.measure(header);
			Object.assign(frame, { header, at: now });
			this.arrivals.set(id, now);
		}
		this.limit();
		const [first] = this.arrivals.keys();
		if (this.arrivals.size > FRAMES_KEPT) this.arrivals.delete(first);
	}

	/** Drop the oldest frames where there are too many, and soonest those of pictures without a lead. */
	limit() {
		const [oldest] = this.frames.keys();
		if (this.frames.size > FRAMES_KEPT) this.drop((other) => other.id === oldest);
		const early = [...this.frames.values()].filter((frame) => frame.at === null
			&& this.pictures.some((key) => frame.items.has(key)));
		if (early.length > EARLY_KEPT) this.drop((other) => other === early[0]);
	}

	/** The pictures that are of another epoch than the leading ones for long, so never of one frame. */
	strangers(now) {
		return [...this.parts].filter(([key, { apartSince }]) => this.pictures.includes(key)
			&& apartSince !== null && now - apartSince > APART_MS).map(([key]) => key);
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

	/** Return the next frame to show, or null: {epoch, seq, header, items, missing}. */
	take(now) {
		const waiting = this.waiting();
		const frame = waiting.findLast((one) => !this.missing(one).length)
			?? waiting.findLast((one) => this.isOver(one, now));
		if (!frame) return null;
		const missing = this.missing(frame);
		if (this.hasPictures(frame)) this.togetherAt = now;
		const isWanted = !missing.length || !(this.onlyComplete || this.isTorn(frame, now));
		if (isWanted) this.frames.delete(frame.id);
		this.taken = frame.seq;
		this.drop((one) => one.epoch === frame.epoch && one.seq <= frame.seq);
		return isWanted ? { ...frame, missing } : null;
	}

	/** When `take` should be called again even if nothing arrives; null if nothing waits. */
	due() {
		const oldest = this.waiting()[0];
		return oldest ? oldest.at + this.patience : null;
	}

	/** Frames whose leading picture is here, oldest first. */
	waiting() {
		return [...this.frames.values()]
			.filter((frame) => frame.at !== null && frame.epoch === this.epoch)
			.sort((a, b) => a.seq - b.seq);
	}

	missing(frame) {
		return [...this.parts.keys()].filter((key) => !frame.items.has(key));
	}

	/** Tell whether a frame lacks a picture, while others in the last second had all pictures. */
	isTorn(frame, now) {
		return !this.hasPictures(frame) && now - this.togetherAt < longestSilence(this.frameTime);
	}

	hasPictures(frame) {
		return this.pictures.every((key) => frame.items.has(key));
	}

	/** How long a frame waits for its parts, ms. */
	get patience() {
		const isTogether = this.onlyComplete || this.pictures.length > 1;
		return (isTogether ? PATIENCE_TOGETHER_FRAMES : PATIENCE_FRAMES) * this.frameTime;
	}

	/** Tell whether a frame has waited long enough, or none of its missing parts can come. */
	isOver(frame, now) {
		return now - frame.at >= this.patience || [...this.parts].every(([key, { at, epoch, seq }]) =>
			frame.items.has(key) || (epoch === frame.epoch && seq > frame.seq)
				|| now - at > longestSilence(this.frameTime));
	}

	/** Discard the frames for which a condition holds. */
	drop(condition) {
		for (const frame of [...this.frames.values()].filter(condition)) {
			this.frames.delete(frame.id);
			frame.items.forEach((item) => this.discard(item));
		}
	}
}
