// The large view's menu of the size and quality in which the server sends a stream, and of the
// stream's addresses for other pages and programs.

import { copyText, streamAddress } from "../export/addresses.js";
import { RAW, topicName } from "../model/streams.js";
import { AS_SENT, QUALITIES, WIDTHS } from "../model/transfer.js";
import { byId, element, setText } from "../ui/elements.js";

const COPIED_MS = 1500;

export class TransferMenu {
	/** `setCommon(choice)` sets that of all streams; `changed()` is called after other choices. */
	constructor(transfer, setCommon, changed) {
		Object.assign(this, { transfer, setCommon, changed, stream: null });
		offer(byId("transfer-width"), WIDTHS, (width) => `at most ${width} pixels wide`);
		offer(byId("transfer-quality"), QUALITIES, (quality) => `JPEG ${quality}`);
		for (const id of ["transfer-width", "transfer-quality"]) {
			byId(id).addEventListener("change", () => this.choose());
		}
		byId("transfer-own").addEventListener("change", ({ target }) => {
			this.transfer.setOwn(this.stream.key, target.checked ? this.chosen : null);
			this.changed();
		});
		for (const name of ["stream", "snapshot"]) {
			byId(`copy-${name}`).addEventListener("click", () => this.copy(name));
		}
	}

	get chosen() {
		const of = (id) => Number(byId(id).value) || null;
		return { width: of("transfer-width"), quality: of("transfer-quality") };
	}

	choose() {
		if (byId("transfer-own").checked) {
			this.transfer.setOwn(this.stream.key, this.chosen);
			this.changed();
		} else {
			this.setCommon(this.chosen);
		}
	}

	/** The menu is now about this stream, whose frames have this size, or null while unknown. */
	follow(stream, frameSize) {
		this.stream = stream;
		const choice = this.transfer.of(stream.key);
		byId("transfer-width").value = choice.width ?? "";
		byId("transfer-quality").value = choice.quality ?? "";
		byId("transfer-own").checked = this.transfer.hasOwn(stream.key);
		byId("transfer-own").disabled = Boolean(this.transfer.fixed);
		byId("transfer-button").setAttribute("aria-pressed",
			String(Boolean(choice.width || choice.quality)));
		// In an address, a width also enlarges.
		const isSmaller = choice.width && !(frameSize && frameSize.width <= choice.width);
		const rendered = { ...AS_SENT, ...choice, width: isSmaller ? choice.width : null };
		const isRaw = topicName(stream) === RAW;
		for (const path of ["stream", "snapshot"]) {
			byId(`address-${path}`).value =
				streamAddress(location.origin, stream.key, rendered, isRaw, path);
		}
	}

	/** Copy the address of the "stream" or of a "snapshot"; it has no token. */
	async copy(name) {
		const isCopied = await copyText(byId(`address-${name}`));
		const button = byId(`copy-${name}`);
		setText(button, isCopied ? "Copied" : "Ctrl-C");
		setTimeout(() => setText(button, "Copy"), COPIED_MS);
	}
}

function offer(list, numbers, words) {
	list.replaceChildren(element("option", { value: "" }, "as sent"),
		...numbers.map((number) => element("option", { value: number }, words(number))));
}
