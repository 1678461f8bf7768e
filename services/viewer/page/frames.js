// The large view's supply: watches pictures and messages, decodes, joins, and hands over frames.
// Emits "frame" with {epoch, seq, header, items, missing}; who gets it owns its bitmaps.

import { NewestDecoder } from "./decoding.js";
import { Events } from "./events.js";
import { Joiner } from "./joining.js";
import { Meter } from "./meter.js";
import { Trails } from "./trails.js";
import { milliseconds } from "./wire.js";

export function release(item) {
	item?.bitmap?.close();
}

export class FrameFeed extends Events {
	constructor(watches, connection) {
		super();
		this.joiner = new Joiner(release);
		this.trails = new Trails();
		this.pictures = [];
		this.messages = [];
		this.watches = watches;
		this.stops = [];
		this.meters = new Map();
		this.endedSince = null;
		this.lastFrameAt = null;
		connection.on("ended", ({ key, since_ns: since }) => {
			if (key === this.pictures[0]) this.endedSince = milliseconds(since);
		});
		connection.on("close", () => {
			this.lastFrameAt = null;
		});
	}

	follow(pictures, messages) {
		this.close();
		this.pictures = pictures;
		this.messages = messages;
		this.joiner.follow(pictures, messages, performance.now());
		for (const key of pictures) this.followPicture(key);
		for (const key of messages) this.stops.push(this.watches.messages(key, (m) => this.take(m)));
	}

	close() {
		for (const stop of this.stops) stop();
		this.stops = [];
		clearTimeout(this.timer);
		this.joiner.follow([], [], 0);
		this.trails.forget();
		this.meters.clear();
		this.endedSince = null;
		this.lastFrameAt = null;
		this.pictures = [];
		this.messages = [];
	}

	meter(key) {
		if (!this.meters.has(key)) this.meters.set(key, new Meter());
		return this.meters.get(key);
	}

	isLive(now) {
		if (this.lastFrameAt === null || this.endedSince !== null) return false;
		const longest = Math.max(1000, 3 * this.joiner.frameTime);
		return now - this.lastFrameAt <= longest && this.meter(this.pictures[0]).isLive(now);
	}

	followPicture(key) {
		const decoder = new NewestDecoder((picture, bitmap) => {
			this.joiner.offer(key, picture.header, { picture, bitmap }, performance.now());
			this.advance();
		});
		const stop = this.watches.picture(key, null, (picture, taken) => {
			this.meter(key).add(performance.now(), picture);
			if (key === this.pictures[0]) this.endedSince = null;
			decoder.offer(picture, taken);
		});
		this.stops.push(stop, () => decoder.close());
	}

	take({ key, header, body }) {
		this.trails.add(key, header, body);
		this.joiner.offer(key, header, body, performance.now());
		this.advance();
	}

	advance() {
		clearTimeout(this.timer);
		const now = performance.now();
		const frame = this.joiner.take(now);
		if (frame) {
			this.lastFrameAt = now;
			this.emit("frame", frame);
		}
		const due = this.joiner.due();
		if (due !== null) this.timer = setTimeout(() => this.advance(), Math.max(1, due - now));
	}
}
