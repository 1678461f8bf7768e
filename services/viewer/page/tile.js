// One stream on the wall: a small moving picture that never looks live when it is not.

import { NewestDecoder } from "./decoding.js";
import { element, mark, say } from "./elements.js";
import { duration, rate } from "./format.js";
import { Meter } from "./meter.js";
import { silenceOf, streamName, topicName } from "./naming.js";

const WIDTHS = [160, 240, 320, 480, 640];
const QUALITY = 70;

export class Tile {
	/** `pace()`: least ms between two pictures; `serverNow()`: its clock, ms since 1970. */
	constructor(stream, watches, pace, serverNow) {
		this.key = stream.key;
		Object.assign(this, { watches, pace, serverNow });
		this.stop = null;
		this._ended = null;
		this.width = null;
		this.forget();
		this.build(stream);
		this.update(stream);
	}

	update(stream) {
		this.stream = stream;
		if (stream.live) this._ended = null;
		this.tick(performance.now());
	}

	ended(since) {
		this._ended = since;
	}

	show(visible) {
		if (!visible) this.unwatch();
		else this.watch();
	}

	resize() {
		if (this.stop && this.wantedWidth() !== this.width) {
			this.unwatch();
			this.watch();
		}
	}

	close() {
		this.unwatch();
		this.element.remove();
	}

	tick(now) {
		const live = this.stop !== null && this.meter.isLive(now) && this._ended === null
			&& this.stream.live;
		mark(this.canvas, "live", live);
		mark(this.element, "state", live ? "live" : this.reason());
		say(this.state, live ? "" : this.words(now));
		say(this.rate, live ? rate(this.meter.rate(now)) : "");
		say(this.age, live && this.sent ? duration(this.sent.ageMs + now - this.sent.at) : "");
	}

	build(stream) {
		this.canvas = element("canvas", { width: 320, height: 240, "data-live": "false",
			"data-key": this.key });
		this.context = this.canvas.getContext("2d", { alpha: false });
		this.state = element("span", { class: "tile-state" });
		this.rate = element("span", { class: "tile-rate" });
		this.age = element("span", { class: "tile-age" });
		this.link = element("a", { href: `#${this.key}`, "aria-label": `Show ${streamName(stream)} large` },
			element("span", { class: "tile-picture" }, this.canvas, this.state),
			element("span", { class: "tile-caption" },
				element("i", { class: "lamp", "aria-hidden": "true" }),
				element("b", {}, stream.camera), element("span", { class: "topic" }, topicName(stream)),
				this.rate, this.age));
		this.element = element("li", { class: "tile", "data-key": this.key }, this.link);
	}

	reason() {
		if (!this.stream.live || this._ended !== null) return "stopped";
		return this.meter.lastAt === null ? "waiting" : "stopped";
	}

	words(now) {
		if (this.watches.isLeftOut(this.key)) return "too many are in view at once";
		return silenceOf(this.stream, this._ended, this.meter, now, this.serverNow());
	}

	wantedWidth() {
		const pixels = (this.element.clientWidth || 320) * Math.min(devicePixelRatio || 1, 2);
		return WIDTHS.find((width) => width >= pixels * 0.9) ?? WIDTHS.at(-1);
	}

	watch() {
		if (this.stop) return;
		this.width = this.wantedWidth();
		this.decoder = new NewestDecoder((picture, bitmap) => this.decoded(picture, bitmap));
		const decoder = this.decoder;
		const size = { width: this.width, quality: QUALITY };
		this.stop = this.watches.picture(this.key, size, (picture, taken) => {
			this.meter.add(performance.now(), picture);
			this._ended = null;
			decoder.offer(picture, () => this.paced(taken));
		});
	}

	unwatch() {
		this.stop?.();
		this.stop = null;
		this.decoder?.close();
		this.decoder = null;
		this.forget();
	}

	/** What was seen before is not live: begin as if nothing had come yet. */
	forget() {
		this.meter = new Meter();
		this.sent = null;
		this.nextAt = 0;
		this.bitmap?.close();
		this.bitmap = null;
	}

	/** Say "taken" not before this tile's time has come; the server then sends the newest. */
	paced(taken) {
		const now = performance.now();
		const wait = this.nextAt - now;
		this.nextAt = Math.max(now, this.nextAt) + this.pace();
		if (wait > 1) setTimeout(taken, wait);
		else taken();
	}

	decoded(picture, bitmap) {
		this.bitmap?.close();
		const isFirst = !this.bitmap;
		this.bitmap = bitmap;
		this.sent = picture;
		if (isFirst) requestAnimationFrame(() => this.paint());
	}

	paint() {
		const bitmap = this.bitmap;
		if (!bitmap) return;
		this.bitmap = null;
		if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
			this.canvas.width = bitmap.width;
			this.canvas.height = bitmap.height;
		}
		this.context.drawImage(bitmap, 0, 0);
		bitmap.close();
		const { epoch, seq } = this.sent.header;
		mark(this.canvas, "epoch", epoch);
		mark(this.canvas, "seq", seq);
		this.tick(performance.now());
	}
}
