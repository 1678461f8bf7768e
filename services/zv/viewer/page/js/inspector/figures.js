// The figures below the large view: age, rate, losses, size and time of the leading picture.

import { milliseconds } from "../transport/connection.js";
import { byId, setText } from "../ui/elements.js";
import { clock, count, duration, pictureSize, shownRate, size } from "../ui/format.js";

/** Write them for a frame and its picture, both perhaps absent; the age grows if `isAging`. */
export function writeFigures({ frame, picture, statistics, isAging }) {
	const now = performance.now();
	const { data } = picture ?? {};
	const stamp = frame && milliseconds(frame.header.stamp_ns); // by the camera's clock
	const texts = {
		age: duration(picture && isAging ? picture.ageMs + now - picture.at : null),
		rate: shownRate(statistics?.arrivalRate(now) ?? null, statistics?.rate(now) ?? null),
		lost: picture ? count(statistics.lost) : "–",
		skipped: picture ? count(statistics.skipped) : "–",
		size: picture ? `${pictureSize(picture)} · ${size(data.byteLength)}` : "–",
		frame: frame ? String(frame.seq) : "–",
		time: frame ? `${clock(stamp)}.${String(Math.floor(stamp % 1000)).padStart(3, "0")}` : "–",
	};
	for (const [name, text] of Object.entries(texts)) setText(byId(`figure-${name}`), text);
	byId("figure-frame").title = frame ? `epoch ${frame.epoch}` : "";
}
