// Where things were in the last seconds, by stream and id, up to a given frame and not beyond.

import { between } from "./wire.js";

const TRAIL_MS = 2000;
const POINTS_KEPT = 400;

export class Trails {
	constructor() {
		this.streams = new Map();
	}

	/** Keep the places of one message: a centroid or tracks. */
	add(key, header, body) {
		const marks = marksOf(body);
		let kept = this.streams.get(key);
		if (!kept || kept.epoch !== header.epoch) {
			kept = { epoch: header.epoch, points: [] };
			this.streams.set(key, kept);
		}
		kept.points.push({ seq: header.seq, stamp: header.stamp_ns, marks });
		if (kept.points.length > POINTS_KEPT) kept.points.shift();
	}

	/** Return id -> [[x, y], ...], oldest first, of the last two seconds up to this frame. */
	upTo(key, header) {
		const kept = this.streams.get(key);
		const trails = new Map();
		if (kept?.epoch !== header.epoch) return trails;
		for (const { seq, stamp, marks } of kept.points) {
			if (seq > header.seq || between(stamp, header.stamp_ns) > TRAIL_MS) continue;
			for (const { id, x, y } of marks) {
				if (!trails.has(id)) trails.set(id, []);
				trails.get(id).push([x, y]);
			}
		}
		return trails;
	}

	forget() {
		this.streams.clear();
	}
}

/** What a message marks in its frame: [{id, label, x, y, box, state}]; id "" is a centroid. */
export function marksOf({ tracks, x, y, box }) {
	const marks = Array.isArray(tracks) ? tracks.map((track) => ({ ...track,
		label: track?.state === "confirmed" ? `${track.id}` : `${track?.id} ${track?.state}` }))
		: [{ id: "", label: `${x}, ${y}`, x, y, box, state: "confirmed" }];
	return marks.filter(isPlaced);
}

/** What the server passes on of fields that it does not know may be anything. */
function isPlaced({ x, y, box }) {
	return Array.isArray(box) && box.length === 4 && [x, y, ...box].every(Number.isFinite);
}
