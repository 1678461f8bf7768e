// The large view's two menus: the overlays on the picture, and the streams beside it.

import { overlayStreams, pictureStreams, streamName, topicName } from "../model/streams.js";
import { byId, checkbox, element, replaceRows } from "../ui/elements.js";
import { KeptChoices, loadPreference, savePreference } from "../ui/preferences.js";

export class Menus {
	/** `changed()` is called after each choice; `showBeside(keys)` with the streams to show. */
	constructor(system, changed, showBeside) {
		this.system = system;
		this.changed = changed;
		this.showBeside = showBeside;
		this.overlays = new KeptChoices("overlays"); // topic -> whether it is drawn
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

	/** Write both menus for the present streams; `keys` are shown, `lead` is the first of them. */
	write(keys, lead) {
		const { camera } = lead;
		const overlays = overlayStreams(this.system.streams, camera);
		const all = pictureStreams(this.system.streams);
		const own = all.filter((one) => one.camera === camera);
		const others = all.filter((one) => one.camera !== camera
			&& (topicName(one) === topicName(lead) || keys.includes(one.key)));
		const besides = (streams, nameOf) => streams.map((stream) => checkbox(nameOf(stream),
			keys.includes(stream.key), (on) => this.setBeside(keys, stream.key, on)));
		replaceRows(byId("overlay-menu"), [
			...overlays.map((stream) => checkbox(stream.topic, this.isDrawn(stream),
				(on) => {
					this.overlays.set(stream.topic, on);
					this.changed();
				})),
			overlays.length ? null : element("p", {}, "This camera has no centroid and no tracks."),
			element("hr"),
			checkbox("trails of 2 s", this.trails, (on) => this.set("trails", on)),
			checkbox("zones and lines", this.shapes, (on) => this.set("shapes", on)),
			checkbox("only frames with their overlay", this.onlyComplete,
				(on) => this.set("onlyComplete", on),
				{ title: "The picture then waits longer for its messages, and is dropped without them" }),
		]);
		replaceRows(byId("beside-menu"), [...besides(own, topicName),
			others.length ? element("hr") : null, ...besides(others, streamName)]);
	}

	/** The default choice: the centroid, and the tracker's tracks or else the truth. */
	isDrawn({ topic, camera }) {
		return this.overlays.get(topic) ?? (topic !== "truth"
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
