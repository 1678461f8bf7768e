// Streams: their names and order, the statistics of their arrival, and why one is not live.

import { clock, duration } from "../ui/format.js";
import { EVENT_TYPE } from "./events.js";

export const RAW = "raw";

/** The edge detector's steps, which it makes only while someone watches them. */
export const STAGES = ["smoothed", "magnitude", "direction", "suppressed", "thresholded"];

const ORDER = ["image", "tracked", "mask", "edges", ...STAGES, "background", RAW];
const OVERLAY_ORDER = ["centroid", "tracks", "truth"];
const WINDOW_MS = 3000;
const LEAST_MS = 1000; // over less time, a single late picture makes a rate much too high
const SILENCE_MS = 1000;
const FRAMES_OF_SILENCE = 3;
const INTERVALS = 8;

/** "image", "mask", "smoothed": the topic without its common suffix. */
export function topicName(stream) {
	if (stream.kind === "picture" && stream.topic === "image") return RAW; // the uncompressed version
	return stream.topic.replace(/\/compressed$/, "").replace(/^edges\/(?=.)/, "");
}

export function streamName(stream) {
	return `${stream.camera} / ${topicName(stream)}`;
}

/** What is known of a stream that no node has announced, by its key alone. */
export function streamOf(key) {
	const [, camera, ...topic] = key.split("/");
	return { key, kind: "picture", camera, topic: topic.join("/"), type: "", node: "", live: false,
		since: null };
}

/** Picture streams in the wall's order: live ones first, the cameras' own before derived ones. */
export function pictureStreams(streams) {
	const place = (stream) => [...ORDER, topicName(stream)].indexOf(topicName(stream)); // others last
	return streams
		.filter((stream) => stream.kind === "picture")
		.sort((a, b) => b.live - a.live || place(a) - place(b)
			|| topicName(a).localeCompare(topicName(b)) || a.camera.localeCompare(b.camera));
}

/** The keys of a camera's picture, of each step of its edge detector, and of the edges; or none. */
export function stepKeys(streams, camera) {
	const found = pictureStreams(streams).filter((one) => one.camera === camera);
	const keyOf = (topic) => found.find((one) => topicName(one) === topic)?.key;
	if (!STAGES.some(keyOf)) return [];
	return ["image", ...STAGES, "edges"].map(keyOf).filter(Boolean);
}

/** Whether a stream is a step of the edge detector. */
export function isStep(stream) {
	return STAGES.includes(topicName(stream));
}

/** Whether boxes would hide the picture: on a step, and on the edges shown beside one. */
export function staysBare(stream, shown) {
	return isStep(stream) || (topicName(stream) === "edges" && shown.some(isStep));
}

/** The streams with boxes or a centroid of one camera, those of the tracker first. */
export function overlayStreams(streams, camera) {
	return streams
		.filter((stream) => stream.camera === camera && stream.kind === "message"
			&& /vision\.(Centroid|Tracks)\.v1/.test(stream.type))
		.sort((a, b) => OVERLAY_ORDER.indexOf(a.topic) - OVERLAY_ORDER.indexOf(b.topic));
}

/** Whether a tracker with zones and lines publishes of a camera. */
export function hasShapes(streams, camera) {
	return streams.some((stream) => stream.camera === camera && stream.type === EVENT_TYPE);
}

export function median(values) {
	return [...values].sort((a, b) => a - b)[(values.length - 1) >> 1];
}

/** The silence, in ms, after which a stream with this frame time is not live. */
export function longestSilence(frameTime) {
	return Math.max(SILENCE_MS, FRAMES_OF_SILENCE * frameTime);
}

/** Statistics of one stream at this page: its rate, its losses, and whether it is live. */
export class StreamStatistics {
	constructor(endedSince = null) {
		this.endedSince = endedSince; // since when the server has had nothing, ms since 1970
		this.epoch = null; // of the newest picture
		this.samples = [];
		this.intervals = [];
		this.lost = 0;
		this.skipped = 0;
		this.lastAt = null;
	}

	/** Count one picture that arrived at `now`, ms; `skipped` others were not sent to this page. */
	add(now, { skipped = 0, lost = 0, header: { epoch } }) {
		if (epoch !== this.epoch) Object.assign(this, { epoch, samples: [], intervals: [] });
		if (this.samples.length) this.intervals.unshift(now - this.lastAt);
		this.intervals.splice(INTERVALS);
		this.samples.push({ now, frames: 1 + skipped });
		while (now - this.samples[0].now > WINDOW_MS && this.samples.length > 2) this.samples.shift();
		this.lost = lost;
		this.skipped += skipped;
		this.lastAt = now;
		this.endedSince = null;
	}

	/** Frames a second of the stream, whether shown here or not; null over less than a second. */
	rate(now) {
		const [, ...counted] = this.samples;
		return this.perSecond(now, counted.reduce((sum, sample) => sum + sample.frames, 0));
	}

	/** Pictures a second that arrived here; null over less than a second. */
	arrivalRate(now) {
		return this.perSecond(now, this.samples.length - 1);
	}

	/** The rate for this number of frames since the first sample. */
	perSecond(now, frames) {
		if (!this.isLive(now)) return null;
		const passed = this.samples.at(-1).now - this.samples[0].now;
		return passed < LEAST_MS ? null : 1000 * frames / passed;
	}

	/** Tell whether a picture arrived within a second or three frame times. */
	isLive(now) {
		if (this.lastAt === null || this.endedSince !== null) return false;
		return now - this.lastAt <= this.longestSilence;
	}

	/** The silence, in ms, after which the stream is not live. */
	get longestSilence() {
		// The median, since a single gap is not the usual frame time.
		return longestSilence(median(this.intervals) ?? 0);
	}

	/** Return why a stream is not live; `serverNow` is in ms since 1970. */
	explainSilence(stream, now, serverNow) {
		const since = stream.live ? this.endedSince : stream.since;
		if (since !== null) {
			const passed = duration(Math.max(0, serverNow - since));
			return `${stream.live ? "no picture" : "node gone"} since ${clock(since)}\n${passed}`;
		}
		if (this.lastAt === null) return "waiting for a picture";
		return `no picture for ${duration(now - this.lastAt)}`;
	}
}
