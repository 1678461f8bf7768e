// Watches the pictures and messages of the large view, and joins those of the same epoch and
// sequence number into frames.
//
// The first picture stream leads. A frame is complete when all its parts have arrived. Two frame
// times after the arrival of its leading picture, it is released without the missing messages. It
// waits longer for the pictures of other streams, and not at all for parts that can no longer
// arrive because their stream has sent a later part or is silent. Frames are released in order. A
// complete frame is released before older incomplete ones, which are dropped.

import { longestSilence, median, StreamStatistics } from "../model/streams.js";
import { between } from "../transport/connection.js";
import { Trails } from "./overlay.js";
import { release } from "./watches.js";

const PATIENCE_FRAMES = 2;
const PATIENCE_TOGETHER_FRAMES = 12; // if showing the same frame matters more than a low delay
const FIRST_GUESS_MS = 50;
const INTERVALS = 15;
const FRAMES_KEPT = 128;

export class FrameFeed {
	/** `display({epoch, seq, header, items, missing})` owns the bitmaps of a frame. */
	constructor(watches, connection, display) {
		Object.assign(this, { watches, display, stops: [] });
		this.joiner = new FrameJoiner(release);
		this.close();
		connection.on("close", () => {
			this.lastFrameAt = null;
		});
	}

	/**
	 * Follow these streams instead; the first of `pictures` leads. `optionsOf(key)` says how one is
	 * to be rendered.
	 */
	follow(pictures, messages, optionsOf) {
		this.close();
		this.messages = messages;
		this.joiner.follow(pictures, messages, performance.now());
		this.stops = [...pictures.map((key, index) => this.watches.watchPictures(key, optionsOf(key),
			index ? new StreamStatistics() : this.statistics,
			(picture, bitmap) => this.offer(key, picture.header, { picture, bitmap })),
		), ...messages.map((key) => this.watches.watchMessages(key, ({ header, body }) => {
			this.trails.add(key, header, body);
			this.offer(key, header, body);
		}))];
	}

	close() {
		for (const stop of this.stops) stop();
		clearTimeout(this.timer);
		this.joiner.follow([], [], 0);
		this.trails = new Trails();
		this.statistics = new StreamStatistics(); // of the leading stream
		Object.assign(this, { stops: [], messages: [], lastFrameAt: null });
	}

	isLive(now) {
		// On a slow link, pictures arrive less often than the camera makes them.
		const silence = Math.max(longestSilence(this.joiner.frameTime), this.statistics.longestSilence);
		return this.lastFrameAt !== null && this.statistics.isLive(now)
			&& now - this.lastFrameAt <= silence;
	}

	offer(key, header, item) {
		this.joiner.offer(key, header, item, performance.now());
		this.advance();
	}

	advance() {
		clearTimeout(this.timer);
		const now = performance.now();
		const frame = this.joiner.take(now);
		if (frame) {
			this.lastFrameAt = now;
			this.display(frame);
		}
		const due = this.joiner.due();
		if (due !== null) this.timer = setTimeout(() => this.advance(), Math.max(1, due - now));
	}
}

export class FrameJoiner {
	/** `discard(item)` is called for each item that will never be released. */
	constructor(discard) {
		this.onlyComplete = false;
		this.discard = discard;
		this.frames = new Map(); // id -> {id, epoch, seq, header, items, at}, `at` with its picture
		this.follow([], [], 0);
	}

	/** Start again. The first of `pictures` leads; the others and `messages` are its parts. */
	follow(pictures, messages, now) {
		this.drop(() => true);
		this.lead = pictures[0] ?? null;
		this.pictures = pictures;
		this.togetherAt = now; // when a frame with all pictures was last taken
		this.parts = new Map([...pictures.slice(1), ...messages].map((key) =>
			[key, { at: now, epoch: null, seq: -1, lag: null }]));
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
		const isLead = key === this.lead;
		const part = this.parts.get(key);
		// The server sends the pictures of a stream in order, so a lower number is a valid restart.
		if (isLead && (epoch !== this.epoch || seq < this.taken)) {
			Object.assign(this, { epoch, taken: -1, last: null });
			this.drop((frame) => frame.epoch !== epoch || frame.seq > seq);
		}
		if (part) {
			const arrival = this.arrivals.get(id);
			const lag = arrival === undefined ? part.lag : now - arrival;
			Object.assign(part, { at: now, epoch, seq, lag });
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
		const [oldest] = this.frames.keys();
		if (this.frames.size > FRAMES_KEPT) this.drop((other) => other.id === oldest);
		const [first] = this.arrivals.keys();
		if (this.arrivals.size > FRAMES_KEPT) this.arrivals.delete(first);
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
		return now - frame.at >= this.patience || this.missing(frame).every((key) => {
			const { at, epoch, seq } = this.parts.get(key);
			const isFurther = epoch === frame.epoch && seq > frame.seq;
			return isFurther || now - at > longestSilence(this.frameTime);
		});
	}

	/** Discard the frames for which a condition holds. */
	drop(condition) {
		for (const frame of [...this.frames.values()].filter(condition)) {
			this.frames.delete(frame.id);
			frame.items.forEach((item) => this.discard(item));
		}
	}
}
