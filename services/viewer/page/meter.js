// Figures of one stream as it arrives here: rate, losses, and whether it is live.

const WINDOW_MS = 3000;
const LEAST_SILENCE_MS = 1000;
const FRAMES_OF_SILENCE = 3;
const INTERVALS = 8;

export class Meter {
	constructor() {
		this.begin();
		this.lost = 0;
		this.skipped = 0;
		this.lastAt = null;
	}

	/** What was usual is not of a new epoch. */
	begin(epoch) {
		Object.assign(this, { epoch, samples: [], intervals: [] });
	}

	/** Count one picture that came at `now`, ms; `skipped` others were not sent to this page. */
	add(now, { skipped = 0, lost = 0, header } = {}) {
		if (header?.epoch !== this.epoch) this.begin(header?.epoch);
		if (this.samples.length) {
			this.intervals = [now - this.lastAt, ...this.intervals].slice(0, INTERVALS);
		}
		this.samples.push({ now, frames: 1 + skipped });
		while (now - this.samples[0].now > WINDOW_MS && this.samples.length > 2) {
			this.samples.shift();
		}
		this.lost = lost;
		this.skipped += skipped;
		this.lastAt = now;
	}

	get frameTime() {
		if (this.samples.length < 2) return null;
		const frames = this.samples.slice(1).reduce((sum, sample) => sum + sample.frames, 0);
		return (this.samples.at(-1).now - this.samples[0].now) / frames;
	}

	/** Frames a second that the stream has, shown here or not; null before the second. */
	rate(now) {
		const each = this.frameTime;
		if (each === null || !this.isLive(now)) return null;
		return 1000 / Math.max(each, 0.1);
	}

	/** Tell whether a picture came within a second or three frame times. */
	isLive(now) {
		if (this.lastAt === null) return false;
		const longest = Math.max(LEAST_SILENCE_MS, FRAMES_OF_SILENCE * this.pictureTime());
		return now - this.lastAt <= longest;
	}

	/** The median: one gap behind which the stream came back is not what is usual. */
	pictureTime() {
		const { intervals } = this;
		return [...intervals].sort((a, b) => a - b)[(intervals.length - 1) >> 1] ?? 0;
	}
}
