// The large view's menus: the overlays on the picture, the streams beside it, and the size and
// quality in which the server sends a stream, with its addresses for other pages and programs.

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

/**
 * Fill the menu of the size and quality of a stream, and of its addresses. `setCommon(choice)` sets
 * those of all streams; `changed()` is called after other choices. Returns {follow, copyAddress}.
 */
export function transferMenu(transfer, setCommon, changed) {
	/** @type {any} */
	let stream = null;
	const [width, quality, own] = ["width", "quality", "own"].map((name) => byId(`transfer-${name}`));
	const numberOf = (list) => Number(list.value) || null;
	const chosen = () => ({ width: numberOf(width), quality: numberOf(quality) });

	/** Set the choice for this stream; with null, it has that of all streams again. */
	function setOwn(choice) {
		transfer.streams.set(stream.key, choice);
		changed();
	}

	/** The menu is now about this stream, whose frames have this size, or null while unknown. */
	function follow(wanted, frameSize) {
		stream = wanted;
		const choice = transfer.of(stream.key);
		width.value = choice.width ?? "";
		quality.value = choice.quality ?? "";
		own.checked = transfer.hasOwn(stream.key);
		own.disabled = Boolean(transfer.fixed);
		byId("transfer-button").ariaPressed = Boolean(choice.width || choice.quality);
		// In an address, a width also enlarges.
		const isSmaller = choice.width && !(frameSize && frameSize.width <= choice.width);
		const rendered = { ...choice, width: isSmaller ? choice.width : null };
		for (const path of PATHS) {
			byId(`address-${path}`).value = streamAddress(pageFolder(), stream.key, rendered,
				topicName(stream) === RAW, path);
		}
	}

	/** Open the menu and copy the stream's address. */
	function copyAddress() {
		if (!byId("transfer-menu").matches(":popover-open")) byId("transfer-button").click();
		copyText(byId("copy-stream"), byId("address-stream"));
	}

	const widths = WIDTHS.map((each) => [each, `at most ${each} pixels wide`]);
	setOptions(width, [["", "as sent"], ...widths]);
	setOptions(quality, [["", "as sent"], ...QUALITIES.map((each) => [each, `JPEG ${each}`])]);
	for (const list of [width, quality]) {
		list.addEventListener("change", () => own.checked ? setOwn(chosen()) : setCommon(chosen()));
	}
	own.addEventListener("change", () => setOwn(own.checked ? chosen() : null));
	for (const path of PATHS) copies(byId(`copy-${path}`), byId(`address-${path}`));
	return { follow, copyAddress };
}
