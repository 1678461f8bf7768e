// The events of one camera as marks on plots: those that the viewer keeps, and those that arrive.

import { askFor, EVENT_TYPE, merged, queryOf, wordsOf } from "../model/events.js";
import { HISTORY_MS } from "../model/system.js";

const MOST = 1000;

/**
 * Returns {follow, marks}: `follow(camera)` follows the events of a camera, or of none; `marks()`
 * returns what is known of them, [{at, words}], `at` by the page's own clock.
 */
export function eventMarks(system, watches) {
	let camera = null;
	/** @type {any[]} */
	let marks = [];

	function receive({ body }) {
		marks = [...marks, { at: performance.now(), words: wordsOf(body) }].slice(-MOST);
	}

	function follow(wanted) {
		const isNew = wanted !== camera;
		if (isNew) marks = [];
		camera = wanted;
		const streams = system.streams.filter((one) => one.camera === camera && one.type === EVENT_TYPE);
		watches.watchMessages(streams.map(({ key }) => key), receive);
		if (isNew && camera) fetchKept(camera);
	}

	/** Take those of before; where none are kept, the answer has none. */
	async function fetchKept(wanted) {
		const { clockOffset: offset, now } = system;
		const query = queryOf({ camera: wanted, since: now - HISTORY_MS, until: now });
		const { events } = await askFor(`most=${MOST}&${query}`);
		if (wanted !== camera || !events) return; // another was chosen meanwhile
		const kept = merged([], events).map((row) => ({ at: row.at - offset, words: wordsOf(row) }));
		marks = [...kept, ...marks].slice(-MOST);
	}

	return { follow, marks: () => marks };
}
