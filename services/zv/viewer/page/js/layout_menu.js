// The menu of the page's layout: which streams the wall shows, in which order and size, and what is
// hidden. Each choice is in the URL at once, so that the same view can be opened elsewhere.

import { copyText } from "./export/addresses.js";
import { HIDEABLE, MOST_COLUMNS, PANELS, writeLayout } from "./model/layout.js";
import { pictureStreams, streamName } from "./model/streams.js";
import { QUALITIES, WIDTHS } from "./model/transfer.js";
import { byId, element, setText } from "./ui/elements.js";

const COPIED_MS = 1500;
const HIDE_WORDS = { top: "top line", bars: "tools and figures", captions: "captions" };

export class LayoutMenu {
	/** `change(part)` changes some fields of the layout and shows it. */
	constructor(system, transfer, change) {
		Object.assign(this, { system, transfer, change, layout: null });
		const columns = Array.from({ length: MOST_COLUMNS }, (_, index) => index + 1);
		this.number("layout-columns", "columns", columns, "as fits");
		this.number("layout-width", "width", WIDTHS, "as sent");
		this.number("layout-quality", "quality", QUALITIES, "as sent");
		const panels = ["none", ...PANELS].map((name) => element("option", {}, name));
		byId("layout-panel").append(element("option", { value: "" }, "as it is"), ...panels);
		byId("layout-panel").addEventListener("change", ({ target }) =>
			this.change({ panel: target.value || null }));
		byId("layout-hide").append(...HIDEABLE.map((part) => element("label", {},
			element("input", { type: "checkbox", value: part, onchange: () => this.hide() }),
			HIDE_WORDS[part])));
		byId("layout-copy").addEventListener("click", () => this.copy());
		byId("layout-menu").addEventListener("toggle", () => this.draw());
		system.on("streams", () => this.draw());
	}

	/** The menu is now about this layout. */
	follow(layout) {
		this.layout = layout;
		this.draw();
	}

	draw() {
		if (!byId("layout-menu").matches(":popover-open")) return;
		const { layout } = this;
		const { width, quality } = this.transfer.common;
		byId("layout-columns").value = layout.columns ?? "";
		byId("layout-width").value = width ?? "";
		byId("layout-quality").value = quality ?? "";
		byId("layout-panel").value = layout.panel ?? "";
		for (const box of byId("layout-hide").querySelectorAll("input")) {
			box.checked = layout.hide.includes(box.value);
		}
		this.drawStreams();
		const fragment = writeLayout({ ...layout, width, quality });
		byId("layout-address").value = `${location.origin}/${fragment ? "#" : ""}${fragment}`;
	}

	/** One row for each stream: those that are chosen first, in their order. */
	drawStreams() {
		const { only } = this.layout;
		const all = pictureStreams(this.system.streams).map(({ key }) => key);
		const keys = [...only, ...all.filter((key) => !only.includes(key))];
		const list = byId("layout-streams");
		const focused = list.contains(document.activeElement) && document.activeElement.dataset.choice;
		list.replaceChildren(...keys.map((key) => this.row(key, only.indexOf(key), only.length)));
		if (focused) list.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus();
		setText(byId("layout-count"), only.length ? `${only.length} of them, in this order` : "all");
	}

	row(key, place, count) {
		const stream = this.system.stream(key);
		const isChosen = place >= 0;
		const move = (by, word) => element("button", { type: "button", "data-choice": `${word} ${key}`,
			"aria-label": `${key} ${word}`, disabled: !isChosen || place + by < 0 || place + by >= count,
			onclick: () => this.move(key, by) }, by < 0 ? "▴" : "▾");
		return element("li", {},
			element("label", {}, element("input", { type: "checkbox", checked: isChosen,
				"data-choice": key, onchange: ({ target }) => this.choose(key, target.checked) }),
			stream ? streamName(stream) : key),
			move(-1, "earlier"), move(1, "later"));
	}

	choose(key, isChosen) {
		const rest = this.layout.only.filter((other) => other !== key);
		this.change({ only: isChosen ? [...rest, key] : rest });
	}

	move(key, by) {
		const only = [...this.layout.only];
		const at = only.indexOf(key);
		[only[at], only[at + by]] = [only[at + by], only[at]];
		this.change({ only });
	}

	hide() {
		const boxes = [...byId("layout-hide").querySelectorAll("input:checked")];
		this.change({ hide: boxes.map((box) => box.value) });
	}

	number(id, name, numbers, none) {
		byId(id).append(element("option", { value: "" }, none),
			...numbers.map((number) => element("option", {}, number)));
		byId(id).addEventListener("change", ({ target }) =>
			this.change({ [name]: Number(target.value) || null }));
	}

	async copy() {
		const isCopied = await copyText(byId("layout-address"));
		setText(byId("layout-copy"), isCopied ? "Copied" : "Ctrl-C");
		setTimeout(() => setText(byId("layout-copy"), "Copy"), COPIED_MS);
	}
}
