// The frames of one camera's streams in the large view: watched, joined, held while it is paused, and
// how many of the last had all their messages.

import { longestSilence, StreamStatistics } from "../model/streams.js";
import { number } from "../ui/format.js";
import { FrameJoiner } from "../video/frame_joiner.js";
import { Trails } from "../video/overlay.js";
import { Playback } from "../video/playback.js";
import { release } from "../video/watches.js";

const WINDOW_MS = 1000;

export class CameraFrames {
	/** `changed(this)` is called when there is another frame. */
	constructor(watches, paused, changed) {
		this.watches = watches;
		this.frame = null;
		this.keys = [];
		this.messages = [];
		this.shown = [];
		this.stops = []; // functions that end the watches of pictures
		this.receive = ({ key, header, body }) => {
			this.trails.add(key, header, body);
			this.offer(key, header, body);
		};
		this.onlyComplete = false;
		this.lastFrameAt = null;
		this.trails = new Trails();
		this.statistics = new StreamStatistics(); // of the leading stream
		this.joiner = this.newJoiner([], []);
		this.playback = new Playback((frame, isNew) => {
			this.frame = frame;
			if (isNew) this.count();
			changed(this);
		});
		this.playback.setPaused(paused);
	}

	/**
	 * Follow these streams of pictures, the first of which leads, and of messages; restart only if
	 * something has changed. `optionsOf(key)` says how pictures are to be rendered.
	 */
	follow(keys, messages, optionsOf, onlyComplete) {
		this.onlyComplete = this.joiner.onlyComplete = onlyComplete;
		const followed = JSON.stringify([keys, keys.map(optionsOf), messages]);
		if (followed === this.followed) return;
		const isMore = keys.some((key) => !this.keys.includes(key));
		this.stop();
		this.followed = followed;
		this.optionsOf = optionsOf;
		Object.assign(this, { keys, messages, shown: [], lastFrameAt: null, trails: new Trails(),
			statistics: new StreamStatistics() });
		if (!this.playback.paused) this.start();
		else if (isMore) this.next(); // one that has them all
	}

	newJoiner(pictures, messages) {
		return new FrameJoiner(pictures, messages, release, performance.now(), this.onlyComplete);
	}

	/** Watch the streams that are followed, unless they are watched already. */
	start() {
		if (this.stops.length) return;
		const { keys, messages, optionsOf, watches } = this;
		this.joiner = this.newJoiner(keys, messages);
		this.statistics = new StreamStatistics(this.statistics.endedSince);
		this.stops = keys.map((key, index) => watches.watchPictures(key, optionsOf(key),
			index ? new StreamStatistics() : this.statistics,
			(picture, bitmap) => this.offer(key, picture.header, { picture, bitmap })));
		watches.watchMessages(messages, this.receive);
	}

	/** End the watches, so that nothing is sent; `start` goes on. */
	stop() {
		for (const stop of this.stops.splice(0)) stop();
		this.watches.watchMessages([], this.receive);
		clearTimeout(this.timer);
		this.joiner.drop(() => true);
		this.joiner = this.newJoiner([], []);
	}

	close() {
		this.stop();
		this.playback.setPaused(false); // a step that is being decoded is not shown
	}

	/** Hold the frame that is shown, and let the server send no more; or go on. */
	setPaused(paused) {
		this.playback.setPaused(paused);
		if (paused) this.stop();
		else this.start();
	}

	/** Show one more frame while paused, as soon as it comes. */
	next() {
		this.playback.wantsOne = true;
		this.start();
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
			this.playback.add(frame);
			if (this.playback.isHolding) this.stop();
		}
		const due = this.joiner.due();
		if (due !== null) this.timer = setTimeout(() => this.advance(), Math.max(1, due - now));
	}

	/** The messages that are missing in the current frame. */
	get missing() {
		return this.frame.missing.filter((key) => this.messages.includes(key));
	}

	count() {
		const now = performance.now();
		this.shown.push({ now, isComplete: !this.missing.length });
		while (now - this.shown[0].now > WINDOW_MS) this.shown.shift();
	}

	/** Return how many of the last frames had all their messages, and why others lacked some. */
	overlayState() {
		const { shown, missing, joiner, messages } = this;
		const complete = shown.filter((one) => one.isComplete).length;
		if (!messages.length || (complete === shown.length && !missing.length)) return "";
		const lag = Math.max(...messages.map((key) => joiner.lag(key) ?? -1));
		const wait = 2 * joiner.frameTime;
		const reason = lag > wait
			? ` – they come ${number(lag, 0)} ms after it, it waits ${number(wait, 0)} ms` : "";
		if (complete) return `overlay on ${complete} of ${shown.length} frames${reason}`;
		return `without ${missing.map((key) => key.split("/").at(-1)).join(" and ") || "overlay"}${reason}`;
	}
}
