// The large view's menu of how a picture is shown: turned, mirrored, its range stretched, in colours,
// with the histogram of the leading stream. It does not change what is sent or saved as received.

import { byId, listen, setOptions, setText } from "../ui/elements.js";
import { KeptChoices, themeColour } from "../ui/preferences.js";
import { MAP_NAMES, valueText } from "../video/tone.js";

const RANGES = ["sent", "auto", "fixed"];
const AS_SENT = { range: "sent", low: 0, high: 255, map: "grey" };

export class Adjust {
	/** `changed()` is called after each choice. */
	constructor(orientations, changed) {
		this.orientations = orientations;
		this.changed = changed;
		/** @type {any} */
		this.stream = null; // that the menu is about
		this.toned = null;
		this.choices = new KeptChoices("tones");
		setOptions(byId("colour-map"), MAP_NAMES.map((name) => [name, name]));
		listen("adjust-menu", "toggle", changed);
		listen("range", "change", ({ target }) => this.setRange(target.value));
		listen("colour-map", "change", ({ target }) => this.set({ map: target.value }));
		listen("range-limits", "change", () => this.setLimits());
	}

	/** Whether the histogram is visible. */
	get isOpen() {
		return byId("adjust-menu").matches(":popover-open");
	}

	/** The choice for a stream: {range, low, high, map}. */
	of(key) {
		const choice = { ...AS_SENT, ...this.choices.get(key) };
		const isValid = RANGES.includes(choice.range) && MAP_NAMES.includes(choice.map)
			&& Number.isFinite(choice.low) && choice.high > choice.low;
		return isValid ? choice : AS_SENT;
	}

	get orientation() {
		return this.orientations.of(this.stream.camera);
	}

	/** The menu is now about this stream. */
	follow(stream) {
		const isOther = stream.key !== this.stream?.key;
		if (isOther) this.toned = null;
		this.stream = stream;
		const choice = this.of(stream.key);
		byId("range").value = choice.range;
		byId("colour-map").value = choice.map;
		byId("range-limits").hidden = choice.range !== "fixed";
		for (const name of ["low", "high"]) {
			const field = byId(`range-${name}`);
			if (isOther || field !== document.activeElement) field.value = choice[name];
		}
		byId("adjust-button").setAttribute("aria-pressed",
			String(choice.range !== "sent" || choice.map !== "grey" || this.orientation.text !== "0"));
	}

	/** Turn or mirror the camera's pictures: `how` is a method of Orientation. */
	turn(how) {
		this.orientations.set(this.stream.camera, this.orientation[how]());
		this.changed();
	}

	/** Stretch the range automatically, or show it as sent again. */
	toggleStretch() {
		this.setRange(this.of(this.stream.key).range === "sent" ? "auto" : "sent");
	}

	/** Set the kind of range; a fixed one begins with what is shown. */
	setRange(range) {
		const shown = range === "fixed" && this.toned?.range;
		this.set(shown ? { range, low: Math.round(shown.low), high: Math.round(shown.high) } : { range });
	}

	setLimits() {
		const [low, high] = ["range-low", "range-high"].map((id) => byId(id).valueAsNumber);
		const isValid = Number.isFinite(low) && high > low;
		byId("range-high").setAttribute("aria-invalid", String(!isValid));
		if (isValid) this.set({ low, high });
	}

	set(change) {
		const { key } = this.stream;
		this.choices.set(key, { ...this.of(key), ...change });
		this.changed();
	}

	/** Draw the histogram of the leading picture, with the range that is shown. */
	draw(toned) {
		this.toned = toned;
		const { histogram, range, values } = toned;
		byId("colour-map").disabled = values?.isGrey === false; // it has colours of its own
		if (!this.isOpen || !histogram) return;
		const canvas = byId("histogram");
		const { width, height } = canvas;
		const context = canvas.getContext("2d");
		const top = Math.sqrt(histogram.counts.reduce((most, number) => Math.max(most, number), 1));
		context.clearRect(0, 0, width, height);
		context.fillStyle = themeColour("accent");
		for (const limit of [range.low, range.high]) {
			const share = (limit - histogram.low) / Math.max(1, histogram.high - histogram.low);
			context.fillRect(Math.min(width - 2, Math.max(0, share * width - 1)), 0, 2, height);
		}
		context.fillStyle = themeColour("dim");
		histogram.counts.forEach((number, bin) => {
			const high = Math.sqrt(number) / top * height; // one peak must not hide all others
			context.fillRect(bin * width / 256, height - high, width / 256, high);
		});
		const { unit } = values;
		const span = ({ low, high }) => `${valueText(low, unit)} to ${valueText(high, unit)}`;
		setText(byId("histogram-text"), `${span(histogram)}; shown from ${span(range)}`);
	}
}
