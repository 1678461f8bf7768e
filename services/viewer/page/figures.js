// The large view's figures: age, rate, losses, size, which frame, and how the join does.

import { byId, say } from "./elements.js";
import { clock, count, duration, number, rate, size } from "./format.js";
import { milliseconds } from "./wire.js";

const SHARE_MS = 1000;

export class Figures {
	constructor() {
		this.shown = [];
	}

	add(now, isComplete) {
		this.shown.push({ now, isComplete });
		while (now - this.shown[0].now > SHARE_MS) this.shown.shift();
	}

	clear() {
		this.shown = [];
	}

	write(frame, feed, leadKey, isPaused, isLive) {
		const now = performance.now();
		const meter = feed.meter(leadKey);
		const picture = frame?.items.get(leadKey)?.picture;
		const age = picture ? picture.ageMs + now - picture.at : null;
		const { header, data } = picture ?? {};
		const figures = {
			age: isPaused || isLive ? duration(age) : "–",
			rate: rate(meter.rate(now)),
			lost: picture ? count(meter.lost) : "–",
			skipped: picture ? count(meter.skipped) : "–",
			size: picture ? `${header.width}×${header.height} · ${size(data.byteLength)}` : "–",
			frame: frame ? String(frame.seq) : "–",
			time: frame ? precise(frame.header.stamp_ns) : "–",
		};
		for (const [name, text] of Object.entries(figures)) say(byId(`figure-${name}`), text);
		byId("figure-frame").title = frame ? `epoch ${frame.epoch}` : "";
	}

	/** Say how the overlay joins: {words, isWithout}; empty words if all is well. */
	joining(frame, feed, overlayKeys) {
		if (!frame || !overlayKeys.length) return { words: "", isWithout: false };
		const missing = frame.missing.filter((key) => overlayKeys.includes(key));
		const complete = this.shown.filter((one) => one.isComplete).length;
		if (complete === this.shown.length && !missing.length) return { words: "", isWithout: false };
		const lag = Math.max(...overlayKeys.map((key) => feed.joiner.lag(key) ?? -1));
		const wait = 2 * feed.joiner.frameTime;
		const why = lag > wait
			? ` – they come ${number(lag, 0)} ms after it, it waits ${number(wait, 0)} ms` : "";
		const names = missing.map((key) => key.split("/").at(-1)).join(" and ");
		const words = complete ? `overlay on ${complete} of ${this.shown.length} frames`
			: `without ${names || "overlay"}`;
		return { words: words + why, isWithout: missing.length > 0 };
	}
}

/** "14:03:22.123": when a frame was captured, by the camera's clock. */
function precise(stamp) {
	const ms = milliseconds(stamp);
	return `${clock(ms)}.${String(Math.floor(ms % 1000)).padStart(3, "0")}`;
}
