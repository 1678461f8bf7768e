// The large view's menu of the size and quality in which the server sends a stream, and of the
// stream's addresses for other pages and programs.

import { copies, copyText, pageFolder, streamAddress } from "../export/addresses.js";
import { RAW, topicName } from "../model/streams.js";
import { QUALITIES, WIDTHS } from "../model/transfer.js";
import { byId, listen, setOptions } from "../ui/elements.js";

const PATHS = ["stream", "snapshot"];

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
