// Streams in words and in order: which camera, which topic, what one looks at first.

import { clock, duration } from "./format.js";

export const RAW = "raw";

const ORDER = ["image", "tracked", "mask", "edges", "smoothed", "magnitude", "direction",
	"suppressed", "thresholded", "background", RAW];

/** "image", "mask", "smoothed": the topic without what all of them share. */
export function topicName(stream) {
	if (stream.kind === "picture" && stream.topic === "image") return RAW; // uncompressed twin
	return stream.topic.replace(/\/compressed$/, "").replace(/^edges\/(?=.)/, "");
}

export function streamName(stream) {
	return `${stream.camera} / ${topicName(stream)}`;
}

/** Picture streams as the wall shows them: all cameras, what is made of them, what is gone. */
export function inOrder(streams) {
	const place = (stream) => {
		const at = ORDER.indexOf(topicName(stream));
		return at < 0 ? ORDER.length : at;
	};
	return streams
		.filter((stream) => stream.kind === "picture")
		.sort((a, b) => b.live - a.live || place(a) - place(b)
			|| topicName(a).localeCompare(topicName(b)) || a.camera.localeCompare(b.camera));
}

/** The streams with boxes or a centroid of one camera, those of the tracker first. */
export function overlayStreams(streams, camera) {
	const order = ["centroid", "tracks", "truth"];
	return streams
		.filter((stream) => stream.camera === camera && isOverlay(stream))
		.sort((a, b) => order.indexOf(a.topic) - order.indexOf(b.topic));
}

function isOverlay(stream) {
	return stream.kind === "message" && /vision\.(Centroid|Tracks)\.v1/.test(stream.type);
}

/** Say why a stream is not live; `ended` is since when the server has had nothing, or null. */
export function silenceOf(stream, ended, meter, now, serverNow) {
	const since = stream.live ? ended : stream.since;
	if (since !== null) {
		const passed = duration(Math.max(0, serverNow - since));
		return `${stream.live ? "no picture" : "gone"} since ${clock(since)}\n${passed}`;
	}
	if (meter.lastAt === null) return "waiting for a picture";
	return `no picture for ${duration(now - meter.lastAt)}`;
}
