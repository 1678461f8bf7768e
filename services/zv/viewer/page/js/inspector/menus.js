// The large view's two menus: the overlays on the picture, and the streams beside it.

import { overlayStreams, pictureStreams, streamName, topicName } from "../model/streams.js";
import { byId, checkboxView, drawList, listen } from "../ui/elements.js";
import { KeptChoices, loadPreference, savePreference } from "../ui/preferences.js";

const SWITCHES = ["trails", "shapes", "onlyComplete"];

export class Menus {
	/** `changed()` is called after each choice; `showBeside(keys)` with the streams to show. */
	constructor(system, changed, showBeside) {
		this.system = system;
		this.changed = changed;
		this.showBeside = showBeside;
		this.keys = []; // of the streams that are shown
		this.overlays = new KeptChoices("overlays"); // topic -> whether it is drawn
		this.overlayOn = loadPreference("overlayOn", true);
		this.trails = loadPreference("trails", true);
		this.shapes = loadPreference("shapes", true);
		this.onlyComplete = loadPreference("onlyComplete", false);
		for (const name of SWITCHES) {
			byId(`overlay-${name}`).checked = this[name];
			listen(`overlay-${name}`, "change", ({ target }) => this.set(name, target.checked));
		}
	}

	overlayKeys(camera) {
		if (!this.overlayOn) return [];
		return overlayStreams(this.system.streams, camera)
			.filter((stream) => this.isDrawn(stream)).map((stream) => stream.key);
	}

	/** Write both menus for the present streams; `keys` are shown, `lead` is the first of them. */
	write(keys, lead) {
		this.keys = keys;
		const { camera } = lead;
		const all = pictureStreams(this.system.streams);
		const others = all.filter((one) => one.camera !== camera
			&& (topicName(one) === topicName(lead) || keys.includes(one.key)));
		const beside = (id, streams, nameOf) => drawList(byId(id), streams, (stream) => checkboxView(
			nameOf(stream), ({ key }) => this.keys.includes(key), (on) => this.setBeside(stream.key, on)));
		drawList(byId("overlay-topics"), overlayStreams(this.system.streams, camera), ({ topic }) =>
			checkboxView(topic, (stream) => this.isDrawn(stream), (on) => {
				this.overlays.set(topic, on);
				this.changed();
			}));
		beside("beside-own", all.filter((one) => one.camera === camera), topicName);
		beside("beside-others", others, streamName);
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

	setBeside(key, on) {
		const next = on ? [...this.keys, key] : this.keys.filter((other) => other !== key);
		if (next.length) this.showBeside(next);
		else this.changed();
	}
}
