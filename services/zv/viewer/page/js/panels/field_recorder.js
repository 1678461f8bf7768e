// Keeps the values of chosen numbers in the messages of one camera, over the last minutes.

import { numberAt, numericFields } from "../model/fields.js";
import { streamOf } from "../model/streams.js";
import { HISTORY_MS } from "../model/system.js";

const SLOT_MS = 250;

export class FieldRecorder {
	constructor(system, watches) {
		this.system = system;
		this.watches = watches;
		this.camera = null;
		this.fields = [];
		this.receive = (message) => this.take(streamOf(message.key).topic, message);
		// Topic and name -> [{low, high, newest}], the points {at, value} of each quarter of a second
		// that has any: few enough to be drawn however fast they come, and no spike is lost.
		this.series = new Map();
		this.known = new Map(); // topic -> the names of the numbers in its newest message
	}

	/** Watch these topics of a camera, and keep the values of these [topic, name]. */
	follow(camera, topics, fields) {
		if (camera !== this.camera) {
			this.series.clear();
			this.known.clear();
		}
		this.camera = camera;
		this.fields = fields;
		const kept = fields.map((field) => field.join(" "));
		for (const name of this.series.keys()) if (!kept.includes(name)) this.series.delete(name);
		this.watches.watchMessages(this.system.streams.filter((one) => one.camera === camera
			&& one.kind === "message" && topics.includes(one.topic)).map(({ key }) => key), this.receive);
	}

	take(topic, message, now = performance.now()) { // the clocks of camera and server may differ
		const found = numericFields(message);
		this.known.set(topic, [...found.keys()]);
		for (const [of, name] of this.fields) {
			if (of !== topic) continue;
			const value = found.get(name) ?? numberAt(message, name);
			if (value === null) continue;
			const kept = this.series.get(`${topic} ${name}`) ?? [];
			const point = { at: now, value };
			const slot = kept.at(-1);
			if (!slot || Math.floor(slot.newest.at / SLOT_MS) !== Math.floor(now / SLOT_MS)) {
				kept.push({ low: point, high: point, newest: point });
			} else {
				slot.newest = point;
				if (point.value < slot.low.value) slot.low = point;
				if (point.value > slot.high.value) slot.high = point;
			}
			while (now - kept[0].newest.at > HISTORY_MS) kept.shift();
			this.series.set(`${topic} ${name}`, kept);
		}
	}

	/** The points of a number to draw from this moment on, oldest first, and those just before it. */
	points(topic, name, from = -Infinity) {
		const kept = this.series.get(`${topic} ${name}`) ?? [];
		const begin = kept.findIndex(({ newest }) => newest.at >= from);
		return kept.slice(begin < 0 ? -1 : Math.max(0, begin - 1)).flatMap(({ low, high, newest }) =>
			[...new Set([low, high, newest])].sort((a, b) => a.at - b.at));
	}
}
