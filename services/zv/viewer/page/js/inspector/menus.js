// The large view's menus: the overlays on the picture, the streams beside it, and the size and quality
// in which the server sends a stream, with the stream's addresses for other pages and programs.

import { copies, copyText, pageFolder, streamAddress } from "../export/addresses.js";
import { overlayStreams, pictureStreams, RAW, streamName, topicName } from "../model/streams.js";
import { QUALITIES, WIDTHS } from "../model/transfer.js";
import { byId, checkboxView, drawList, listen, setOptions } from "../ui/elements.js";
import { KeptChoices, loadPreference, savePreference } from "../ui/preferences.js";

const SWITCHES = ["trails", "shapes", "onlyComplete"];
const PATHS = ["stream", "snapshot"];

/** The two menus of what is drawn on the picture and shown beside it. */
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

/** The menu of the size and quality of a stream, and of its addresses. */
export class TransferMenu {
	/** `setCommon(choice)` sets that of all streams; `changed()` is called after other choices. */
	constructor(transfer, setCommon, changed) {
		this.transfer = transfer;
		this.setCommon = setCommon;
		this.changed = changed;
		this.stream = null;
		/** @type {[string, number[], (size: number) => string][]} */
		const choices = [
			["width", WIDTHS, (width) => `at most ${width} pixels wide`],
			["quality", QUALITIES, (quality) => `JPEG ${quality}`],
		];
		for (const [name, numbers, words] of choices) {
			setOptions(byId(`transfer-${name}`),
				[["", "as sent"], ...numbers.map((number) => [number, words(number)])]);
			listen(`transfer-${name}`, "change", () => this.choose());
		}
		listen("transfer-own", "change", ({ target }) => this.setOwn(target.checked ? this.chosen : null));
		for (const path of PATHS) copies(byId(`copy-${path}`), byId(`address-${path}`));
	}

	get chosen() {
		const of = (id) => Number(byId(id).value) || null;
		return { width: of("transfer-width"), quality: of("transfer-quality") };
	}

	choose() {
		if (byId("transfer-own").checked) this.setOwn(this.chosen);
		else this.setCommon(this.chosen);
	}

	/** Set the choice for this stream; with null, it has that of all streams again. */
	setOwn(choice) {
		this.transfer.streams.set(this.stream.key, choice);
		this.changed();
	}

	/** The menu is now about this stream, whose frames have this size, or null while unknown. */
	follow(stream, frameSize) {
		this.stream = stream;
		const { width, quality } = this.transfer.of(stream.key);
		byId("transfer-width").value = width ?? "";
		byId("transfer-quality").value = quality ?? "";
		byId("transfer-own").checked = this.transfer.hasOwn(stream.key);
		byId("transfer-own").disabled = Boolean(this.transfer.fixed);
		byId("transfer-button").setAttribute("aria-pressed", String(Boolean(width || quality)));
		// In an address, a width also enlarges.
		const isSmaller = width && !(frameSize && frameSize.width <= width);
		const rendered = { quality, width: isSmaller ? width : null };
		for (const path of PATHS) {
			byId(`address-${path}`).value = streamAddress(pageFolder(), stream.key, rendered,
				topicName(stream) === RAW, path);
		}
	}

	/** Open the menu and copy the stream's address. */
	copyAddress() {
		if (!byId("transfer-menu").matches(":popover-open")) byId("transfer-button").click();
		copyText(byId("copy-stream"), byId("address-stream"));
	}
}
