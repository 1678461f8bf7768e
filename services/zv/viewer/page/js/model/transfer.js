// The size and quality in which the server sends pictures to this page: a choice for all streams,
// and choices for single ones. Without a choice, the pictures arrive as their node sent them.

import { KeptChoices, loadPreference, savePreference } from "../ui/preferences.js";

export const WIDTHS = [1280, 640, 320, 160];
export const QUALITIES = [80, 60, 40, 20];
const AS_SENT = { width: null, quality: null };

export class Transfer {
	page = valid(loadPreference("transfer", AS_SENT));
	streams = new KeptChoices("transfers"); // of their own
	/** @type {any} */
	fixed = null; // of the URL, for all streams

	/** Use the size and quality of a layout instead, if it has any. */
	fix({ width, quality }) {
		this.fixed = width || quality ? { width, quality } : null;
	}

	/** The choice for all streams that have none of their own. */
	get common() {
		return this.fixed ?? this.page;
	}

	hasOwn(key) {
		return !this.fixed && this.streams.get(key) !== undefined;
	}

	/** The choice for a stream: {width, quality}, each null for "as sent". */
	of(key) {
		return this.hasOwn(key) ? valid(this.streams.get(key)) : this.common;
	}

	setCommon(choice) {
		this.page = choice;
		savePreference("transfer", choice);
	}
}

/** Return the fields of a `watch` for a choice: only those that are set. */
export function watchOptions({ width, quality }) {
	return { ...(width && { width }), ...(quality && { quality }) };
}

function valid(choice) {
	const { width, quality } = choice ?? {};
	return { width: WIDTHS.includes(width) ? width : null,
		quality: QUALITIES.includes(quality) ? quality : null };
}
