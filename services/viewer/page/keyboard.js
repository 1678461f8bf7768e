// The keys, each with what it does: one table for the keyboard and for the help.

import { byId, element } from "./elements.js";
import { closeMenus } from "./choices.js";

const PAN_PX = 60;
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KEYS = { Space: [" "], "Shift S": ["S"], "← ↑ → ↓": Object.keys(ARROWS), "+": ["+", "="] };

// Each row: the key as one reads it, what it does, what is called, with what.
const TABLE = {
	Everywhere: [
		["?", "these keys", "help"],
		["w", "all streams", "wall"],
		["/", "filter the streams", "filter"],
		["e", "parameters", "panel", "parameters"],
		["p", "plots", "panel", "plots"],
		["g", "graph of nodes and keys", "panel", "graph"],
		["h", "health", "panel", "health"],
		["l", "log", "panel", "log"],
		["d", "dark or light", "theme"],
		["Esc", "close the menu, the panel, the large view"],
	],
	"On the wall": [
		["← ↑ → ↓", "from stream to stream", "move"],
		["Enter", "show the stream large"],
	],
	"With one stream large": [
		["Space", "pause, go on", "togglePause"],
		[",", "one frame back", "step", -1],
		[".", "one frame on", "step", 1],
		["+", "zoom in", "zoom", 1.25],
		["-", "zoom out", "zoom", 0.8],
		["0", "whole frame", "fit"],
		["1", "one to one", "actual"],
		["← ↑ → ↓", "move the picture", "move"],
		["n", "next stream", "neighbour", 1],
		["b", "stream before", "neighbour", -1],
		["o", "overlay on or off", "toggleOverlay"],
		["f", "full screen", "fullScreen"],
		["s", "save the picture as it came", "save"],
		["Shift S", "save with the overlay, PNG", "saveDrawn"],
	],
};
const ROWS = new Map(Object.values(TABLE).flat().filter((row) => row.length > 2)
	.flatMap((row) => (KEYS[row[0]] ?? [row[0]]).map((key) => [key, row])));

/** Do what a row says; returns whether there was anything to do. */
function act({ wall, large, panels, go, theme, help }, name, [by], key) {
	if (name === "move" && !large.isOpen) return wall.move(key);
	if (name === "move") large.pan(...ARROWS[key].map((share) => share * PAN_PX));
	else if (name === "panel") panels.toggle(by);
	else if (name === "theme") theme();
	else if (name === "help") help.showModal();
	else if (name === "wall" || name === "filter") {
		go([]);
		if (name === "filter") byId("filter").focus();
	} else if (large.isOpen) large[name](by);
	else return false;
	return true;
}

export function listenToKeyboard(others) {
	const help = byId("help");
	const parts = { ...others, help };
	byId("help-keys").replaceChildren(...Object.entries(TABLE).map(helpOf));
	byId("help-button").addEventListener("click", () => help.showModal());
	help.addEventListener("click", (event) => event.target === help && help.close());

	addEventListener("keydown", (event) => {
		if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
		if (event.key === "Escape") {
			if (isTyping(event)) event.target.blur();
			else if (!help.open) escape(parts);
			return;
		}
		if (help.open || isTyping(event)) return;
		const row = ROWS.get(event.key);
		if (row && act(parts, row[2], row.slice(3), event.key)) event.preventDefault();
	});
}

function escape({ large, panels, go }) {
	if (closeMenus() || document.fullscreenElement) return;
	if (panels.open && byId("dock").contains(document.activeElement)) panels.show("");
	else if (large.isOpen) go([]);
	else if (panels.open) panels.show("");
}

/** Tell whether a key belongs to the control that has the focus. */
function isTyping({ target, key }) {
	if (target.closest("select, textarea, input:not([type=checkbox], [type=range])")) return true;
	const usesArrows = target.closest("input[type=range], select, #log-lines");
	if (usesArrows && (key.startsWith("Arrow") || key === " ")) return true;
	return key === " " && Boolean(target.closest("button, summary, input, a"));
}

function helpOf([title, rows]) {
	return element("section", {}, element("h3", {}, title), element("dl", {},
		...rows.flatMap(([shown, words]) => [
			element("dt", {}, ...shown.split(" ").map((key) => element("kbd", {}, key))),
			element("dd", {}, words)])));
}
