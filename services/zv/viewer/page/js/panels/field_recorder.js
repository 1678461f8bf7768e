// Keeps the values of chosen numbers in the messages of one camera, over the last minutes.

import { numericFields } from "../model/fields.js";

const POINTS_KEPT = 9000; // five minutes at 30 Hz
const POINTS_DRAWN = 1200;

export class FieldRecorder {
	constructor(system, watches) {
		Object.assign(this, { system, watches, camera: null });
		this.stops = new Map(); // key of a stream -> the function that ends its watch
		this.series = new Map(); // topic and name -> [{at, value}]
		this.known = new Map(); // topic -> the names of the numbers in its newest message
	}

	/** Watch these topics of a camera, and keep the values of these [topic, name]. */
	follow(camera, topics, fields) {
		if (camera !== this.camera) {
			this.series.clear();
			this.known.clear();
		}
		Object.assign(this, { camera, fields });
		const kept = fields.map((field) => field.join(" "));
		for (const name of this.series.keys()) if (!kept.includes(name)) this.series.delete(name);
		const wanted = new Map(this.system.streams
			.filter((one) => one.camera === camera && one.kind === "message" && topics.includes(one.topic))
			.map((one) => [one.key, one.topic]));
		for (const [key, stop] of this.stops) {
			if (wanted.has(key)) continue;
			stop();
			this.stops.delete(key);
		}
		for (const [key, topic] of wanted) {
			if (this.stops.has(key)) continue;
			this.stops.set(key, this.watches.watchMessages(key, (message) => this.take(topic, message)));
		}
	}

	take(topic, message) {
		const found = numericFields(message);
		this.known.set(topic, [...found.keys()]);
		for (const [of, name] of this.fields) {
			if (of !== topic || !found.has(name)) continue;
			const kept = this.series.get(`${topic} ${name}`) ?? [];
			kept.push({ at: this.system.now, value: found.get(name) }); // the camera's clock may differ
			if (kept.length > POINTS_KEPT) kept.shift();
			this.series.set(`${topic} ${name}`, kept);
		}
	}

	/** The values of a number, few enough to be drawn, oldest first. */
	points(topic, name) {
		const kept = this.series.get(`${topic} ${name}`) ?? [];
		const step = Math.ceil(kept.length / POINTS_DRAWN);
		return kept.filter((_, index) => index % step === 0);
	}

	/** The names of the numbers in the newest message of a topic. */
	names(topic) {
		return this.known.get(topic) ?? [];
	}
}
