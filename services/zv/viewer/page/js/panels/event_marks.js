// The events of one camera as marks on plots: those that the viewer keeps, and those that arrive.

import { HISTORY_MS } from "../model/system.js";
import { TYPE, wordsOf } from "./events.js";
import { merged, queryOf } from "./kept_events.js";

const MOST = 1000;

export class EventMarks {
	constructor(system, watches) {
		this.system = system;
		this.watches = watches;
		this.camera = null;
		this.marks = []; // {at, words}, `at` by the page's own clock
		this.stops = new Map(); // key of a stream -> the function that ends its watch
	}

	/** Follow the events of a camera, or of none. */
	follow(camera) {
		const isNew = camera !== this.camera;
		if (isNew) this.marks = [];
		this.camera = camera;
		this.watches.syncMessages(this.stops, new Map(this.system.streams
			.filter((one) => one.camera === camera && one.type === TYPE)
			.map(({ key }) => [key, ({ body }) => this.add([{ at: performance.now(), words: wordsOf(body) }])])));
		if (isNew && camera) this.fetchKept(camera);
	}

	add(marks) {
		this.marks = [...this.marks, ...marks].slice(-MOST);
	}

	/** Take those of before; where none are kept, the answer has none. */
	async fetchKept(camera) {
		const { clockOffset: offset, now } = this.system;
		const query = queryOf({ camera, since: new Date(now - HISTORY_MS), until: new Date(now) });
		const { events } = await fetch(`events?most=${MOST}&${query}`).then((said) => said.json())
			.catch(() => ({}));
		if (camera !== this.camera || !events) return; // another was chosen meanwhile
		const kept = merged([], events).map((row) => ({ at: row.at - offset, words: wordsOf(row) }));
		this.marks = [...kept, ...this.marks].slice(-MOST);
	}
}
