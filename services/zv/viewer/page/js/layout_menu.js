// The menu of the page's layout: which streams the wall shows, in which order and size, and what is
// hidden. Each choice is in the URL at once, so that the same view can be opened elsewhere.

import { copies, pageFolder } from "./export/addresses.js";
import { HIDEABLE, MOST_COLUMNS, PANELS, writeLayout } from "./model/layout.js";
import { pictureStreams, streamName } from "./model/streams.js";
import { QUALITIES, WIDTHS } from "./model/transfer.js";
import { byId, checkbox, element, replaceRows, setOptions, setText } from "./ui/elements.js";

const HIDE_WORDS = { top: "top line", bars: "tools and figures", captions: "captions" };
const COLUMNS = Array.from({ length: MOST_COLUMNS }, (_, index) => index + 1);

// The lists: field of the layout, what stands for null, the other choices.
/** @type {[string, string, (number | string)[]][]} */
const LISTS = [["columns", "as fits", COLUMNS], ["width", "as sent", WIDTHS],
	["quality", "as sent", QUALITIES], ["panel", "as it is", ["none", ...PANELS]]];

export class LayoutMenu {
	/** `change(part)` changes some fields of the layout and shows it. */
	constructor(system, transfer, change) {
		this.system = system;
		this.transfer = transfer;
		this.change = change;
		this.layout = null;
		for (const [name, none, choices] of LISTS) {
			const list = byId(`layout-${name}`);
			setOptions(list, [["", none], ...choices.map((choice) => [choice, choice])]);
			list.addEventListener("change", ({ target: { value } }) =>
				change({ [name]: value === "" ? null : name === "panel" ? value : Number(value) }));
		}
		copies(byId("layout-copy"), byId("layout-address"));
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
		const layout = { ...this.layout, ...this.transfer.common };
		for (const [name] of LISTS) byId(`layout-${name}`).value = layout[name] ?? "";
		const { hide } = layout;
		replaceRows(byId("layout-hide"), HIDEABLE.map((part) =>
			checkbox(HIDE_WORDS[part], hide.includes(part), (on) => this.change({
				hide: HIDEABLE.filter((one) => (one === part ? on : hide.includes(one))) }))));
		this.drawStreams();
		const fragment = writeLayout(layout);
		byId("layout-address").value = `${pageFolder()}/${fragment ? "#" : ""}${fragment}`;
	}

	/** One row for each stream: those that are chosen first, in their order. */
	drawStreams() {
		const { only } = this.layout;
		const all = pictureStreams(this.system.streams).map(({ key }) => key);
		const keys = [...only, ...all.filter((key) => !only.includes(key))];
		replaceRows(byId("layout-streams"), keys.map((key) => this.row(key, only)));
		setText(byId("layout-count"), only.length ? `${only.length} of them, in this order` : "all");
	}

	row(key, only) {
		const stream = this.system.stream(key);
		const at = only.indexOf(key);
		const rest = only.filter((other) => other !== key);
		const move = (by, word) => element("button", { type: "button", "data-choice": `${word} ${key}`,
			"aria-label": `${key} ${word}`, disabled: at < 0 || at + by < 0 || at + by >= only.length,
			onclick: () => this.change({ only: rest.toSpliced(at + by, 0, key) }) }, by < 0 ? "▴" : "▾");
		return element("li", {},
			checkbox(stream ? streamName(stream) : key, at >= 0,
				(on) => this.change({ only: on ? [...rest, key] : rest }), { "data-choice": key }),
			move(-1, "earlier"), move(1, "later"));
	}
}
