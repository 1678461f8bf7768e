// The menu of the page's layout: which streams the wall shows, in which order and size, and what is
// hidden. Each choice is in the URL at once, so that the same view can be opened elsewhere.

import { copies, pageFolder } from "./export/addresses.js";
import { MOST_COLUMNS, PANELS, writeLayout } from "./model/layout.js";
import { pictureStreams, streamName } from "./model/streams.js";
import { QUALITIES, WIDTHS } from "./model/transfer.js";
import { byId, checkboxView, drawList, element, listen, setOptions, setText } from "./ui/elements.js";

const COLUMNS = Array.from({ length: MOST_COLUMNS }, (_, index) => index + 1);

// The lists: field of the layout, what stands for null, the other choices.
/** @type {[string, string, (number | string)[]][]} */
const LISTS = [["columns", "as fits", COLUMNS], ["width", "as sent", WIDTHS],
	["quality", "as sent", QUALITIES], ["panel", "as it is", ["none", ...PANELS]]];

/**
 * Fill the menu. `change(part)` changes some fields of the layout and shows it. Returns a function
 * that makes the menu about a layout.
 */
export function layoutMenu(system, transfer, change) {
	/** @type {any} */
	let layout = null;
	const hides = [...byId("layout-hide").querySelectorAll("input")];

	/** Show a stream at this place of those that are chosen, or no longer. */
	function place(key, at) {
		const rest = layout.only.filter((other) => other !== key);
		change({ only: at === null ? rest : rest.toSpliced(at, 0, key) });
	}

	function makeRow(key) {
		const stream = system.stream(key);
		const box = checkboxView(stream ? streamName(stream) : key, ({ at }) => at >= 0,
			(on) => place(key, on ? layout.only.length : null));
		const [earlier, later] = [[-1, "earlier", "▴"], [1, "later", "▾"]].map(([by, word, sign]) =>
			element("button", { type: "button", "aria-label": `${key} ${word}`,
				onclick: () => place(key, layout.only.indexOf(key) + Number(by)) }, sign));
		return {
			element: element("li", { "data-key": key }, box.element, earlier, later),
			update: (item) => {
				box.update(item);
				earlier.disabled = item.at < 1;
				later.disabled = item.at < 0 || item.isLast;
			},
		};
	}

	/** One row for each stream: those that are chosen first, in their order. */
	function drawStreams({ only }) {
		const all = pictureStreams(system.streams).map(({ key }) => key);
		drawList(byId("layout-streams"), [...new Set([...only, ...all])].map((key) =>
			({ key, at: only.indexOf(key), isLast: key === only.at(-1) })), ({ key }) => makeRow(key));
		setText(byId("layout-count"), only.length ? `${only.length} of them, in this order` : "all");
	}

	function draw() {
		if (!byId("layout-menu").matches(":popover-open")) return;
		const shown = { ...layout, ...transfer.common };
		for (const [name] of LISTS) byId(`layout-${name}`).value = shown[name] ?? "";
		for (const box of hides) box.checked = shown.hide.includes(box.value);
		drawStreams(shown);
		const fragment = writeLayout(shown);
		byId("layout-address").value = `${pageFolder()}/${fragment ? "#" : ""}${fragment}`;
	}

	for (const [name, none, choices] of LISTS) {
		setOptions(byId(`layout-${name}`), [["", none], ...choices.map((choice) => [choice, choice])]);
		listen(`layout-${name}`, "change", ({ target: { value } }) =>
			change({ [name]: value === "" ? null : name === "panel" ? value : Number(value) }));
	}
	copies(byId("layout-copy"), byId("layout-address"));
	listen("layout-hide", "change", () =>
		change({ hide: hides.filter((box) => box.checked).map((box) => box.value) }));
	listen("layout-menu", "toggle", draw);
	system.on("streams", draw);
	return (shown) => {
		layout = shown;
		draw();
	};
}
