// The large view's two menus: the overlays on the picture, and the streams beside it.

import { overlayStreams, pictureStreams, topicName } from "../model/streams.js";
import { byId, element } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";

export class Menus {
	/** `changed()` is called after each choice; `showBeside(keys)` with the streams to show. */
	constructor(system, changed, showBeside) {
		Object.assign(this, { system, changed, showBeside });
		this.overlays = loadPreference("overlays", {}); // topic -> whether it is drawn
		this.overlayOn = loadPreference("overlayOn", true);
		this.trails = loadPreference("trails", true);
		this.shapes = loadPreference("shapes", true);
		this.onlyComplete = loadPreference("onlyComplete", false);
	}

	overlayKeys(camera) {
		if (!this.overlayOn) return [];
		return overlayStreams(this.system.streams, camera)
			.filter((stream) => this.isDrawn(stream)).map((stream) => stream.key);
	}

	/** Write both menus for the present streams; `keys` are shown. */
	write(keys, camera) {
		const overlays = overlayStreams(this.system.streams, camera);
		const others = pictureStreams(this.system.streams).filter((one) => one.camera === camera);
		fill(byId("overlay-menu"), [
			...overlays.map((stream) => check(stream.topic, this.isDrawn(stream),
				(on) => this.set("overlays", { ...this.overlays, [stream.topic]: on }))),
			overlays.length ? null : element("p", {}, "This camera has no centroid and no tracks."),
			element("hr"),
			check("trails of 2 s", this.trails, (on) => this.set("trails", on)),
			check("zones and lines", this.shapes, (on) => this.set("shapes", on)),
			check("only frames with their overlay", this.onlyComplete,
				(on) => this.set("onlyComplete", on),
				"The picture then waits longer for its messages, and is dropped if they do not come"),
		]);
		fill(byId("beside-menu"), others.map((stream) => check(topicName(stream),
			keys.includes(stream.key), (on) => this.setBeside(keys, stream.key, on))));
	}

	/** The default choice: the centroid, and the tracker's tracks or else the truth. */
	isDrawn({ topic, camera }) {
		return this.overlays[topic] ?? (topic !== "truth"
			|| !this.system.streams.some((one) => one.camera === camera && one.topic === "tracks"));
	}

	set(name, value) {
		this[name] = value;
		savePreference(name, value);
		this.changed();
	}

	setBeside(keys, key, on) {
		const next = on ? [...keys, key] : keys.filter((other) => other !== key);
		if (next.length) this.showBeside(next);
		else this.changed();
	}
}

function check(label, checked, chosen, title = null) {
	return element("label", { title },
		element("input", { type: "checkbox", checked, "data-choice": label,
			onchange: (event) => chosen(event.target.checked) }),
		element("span", {}, label));
}

/** Replace a menu's rows; the choice that has the focus keeps it. */
function fill(menu, rows) {
	const focused = menu.contains(document.activeElement) && document.activeElement.dataset.choice;
	menu.replaceChildren(...rows.filter(Boolean));
	if (focused) menu.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus();
}
