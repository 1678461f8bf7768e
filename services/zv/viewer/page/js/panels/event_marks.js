// The events of one camera as marks on plots: those that the viewer keeps, and those that arrive.

import { askFor, EVENT_TYPE, merged, queryOf, wordsOf } from "../model/events.js";
import { HISTORY_MS } from "../model/system.js";

const MOST = 1000;

export class EventMarks {
	constructor(system, watches) {
		this.system = system;
		this.watches = watches;
		this.camera = null;
		this.marks = []; // {at, words}, `at` by the page's own clock
		this.receive = ({ body }) => this.add([{ at: performance.now(), words: wordsOf(body) }]);
	}

	/** Follow the events of a camera, or of none. */
	follow(camera) {
		const isNew = camera !== this.camera;
		if (isNew) this.marks = [];
		this.camera = camera;
		this.watches.watchMessages(this.system.streams.filter((one) => one.camera === camera
			&& one.type === EVENT_TYPE).map(({ key }) => key), this.receive);
		if (isNew && camera) this.fetchKept(camera);
	}

	add(marks) {
		this.marks = [...this.marks, ...marks].slice(-MOST);
	}

	/** Take those of before; where none are kept, the answer has none. */
	async fetchKept(camera) {
		const { clockOffset: offset, now } = this.system;
		const query = queryOf({ camera, since: now - HISTORY_MS, until: now });
		const { events } = await askFor(`most=${MOST}&${query}`);
		if (camera !== this.camera || !events) return; // another was chosen meanwhile
		const kept = merged([], events).map((row) => ({ at: row.at - offset, words: wordsOf(row) }));
		this.marks = [...kept, ...this.marks].slice(-MOST);
	}
}
