// Keyboard commands: one table for the keyboard and for the help.

import { byId, element, listen } from "./ui/elements.js";
import { loadPreference, savePreference } from "./ui/preferences.js";

const PAN_PX = 60;
const FAR_PX = 10; // of the frame, by which Shift moves a corner
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KEYS = { Space: [" "], "Shift S": ["S"], "← ↑ → ↓": Object.keys(ARROWS), "+": ["+", "="] };

// Each row: the key as shown in the help, its effect, the command, its argument.
const TABLE = {
	Everywhere: [
		["?", "keyboard shortcuts", "click", "help-button"],
		["w", "all streams", "wall"],
		["/", "filter the streams", "filter"],
		["e", "parameters", "panel", "parameters"],
		["p", "plots", "panel", "plots"],
		["g", "graph of nodes and keys", "panel", "graph"],
		["j", "messages", "panel", "message"],
		["v", "events", "panel", "events"],
		["h", "health", "panel", "health"],
		["l", "log", "panel", "log"],
		["d", "dark or light", "click", "theme"],
		["Esc", "close the menu, the panel, the large view; show hidden parts"],
	],
	"On the wall": [
		["← ↑ → ↓", "select a stream", "move"],
		["Enter", "enlarge the stream"],
	],
	"In the large view": [
		["Space", "pause, continue", "togglePause"],
		[",", "one frame back", "step", -1],
		[".", "one frame forward", "step", 1],
		["+", "zoom in", "zoom", 1.25],
		["-", "zoom out", "zoom", 0.8],
		["0", "whole frame", "fit"],
		["1", "one to one", "actual"],
		["← ↑ → ↓", "move the picture; a chosen corner by 1 pixel, with Shift by 10", "move"],
		["n", "next stream", "neighbour", 1],
		["b", "previous stream", "neighbour", -1],
		["o", "overlay on or off", "toggleOverlay"],
		["z", "draw zones, lines and regions, or end it", "editShapes"],
		["Ctrl Z", "take back the last change of a zone, line or region"],
		["r", "rotate clockwise", "turn", "rotated"],
		["m", "mirror", "turn", "flipped"],
		["c", "stretch the contrast, or not", "stretch"],
		["u", "copy the stream's URL", "copyAddress"],
		["f", "full screen", "fullScreen"],
		["s", "save the picture as received", "save"],
		["Shift S", "save with the overlay, PNG", "saveDrawn"],
	],
};
const ROWS = new Map(Object.values(TABLE).flat().filter((row) => row.length > 2)
	.flatMap((row) => (KEYS[row[0]] ?? [row[0]]).map((key) => [key, row])));

/** Run a command; returns whether it had an effect. */
function run({ wall, inspector, dock, go }, command, argument, { key, shiftKey }) {
	if (command === "move" && !inspector.isOpen) return wall.move(key);
	if (command === "move") {
		const by = ARROWS[key];
		const isNudged = inspector.editor.nudge(by.map((share) => -share * (shiftKey ? FAR_PX : 1)));
		if (!isNudged) inspector.grid.pan(...by.map((share) => share * PAN_PX));
	} else if (command === "panel") dock.toggle(argument);
	else if (command === "click") byId(argument).click();
	else if (command === "wall" || command === "filter") {
		go([]);
		if (command === "filter") byId("filter").focus();
	} else if (inspector.isOpen) inspector.commands[command](argument);
	else return false;
	return true;
}

/** Listen to the keyboard; `parts` is {wall, inspector, dock, go, unhide}. */
export function listenToKeyboard(parts) {
	const help = byId("help");
	const isBehind = () => document.querySelector("dialog[open]") !== null;
	byId("help-keys").replaceChildren(...Object.entries(TABLE).map(helpSection));
	listen("help-button", "click", () => help.showModal());
	help.addEventListener("click", (event) => event.target === help && help.close());
	const shortcuts = byId("shortcuts");
	shortcuts.checked = loadPreference("shortcuts", true) !== false;
	shortcuts.addEventListener("change", () => savePreference("shortcuts", shortcuts.checked));

	addEventListener("keydown", (event) => {
		if (event.defaultPrevented || event.altKey) return;
		if (event.ctrlKey || event.metaKey) {
			const isUndo = event.key === "z" && !event.shiftKey && !isTyping(event);
			if (isUndo && parts.inspector.editor.undo()) event.preventDefault();
			return;
		}
		if (event.key === "Escape") {
			if (isTyping(event)) event.target?.blur();
			else if (!isBehind()) escape(parts);
			return;
		}
		if (isBehind() || isTyping(event) || moveInToolbar(event) || !shortcuts.checked) return;
		const row = ROWS.get(event.key);
		if (row && run(parts, row[2], row[3], event)) event.preventDefault();
	});
}

/** Show what is hidden; else close the panel, else the large view. Menus close by themselves. */
function escape({ inspector, dock, go, unhide }) {
	if (document.querySelector(":popover-open") || document.fullscreenElement) return;
	if (inspector.editor.escape() || unhide()) return;
	if (dock.open && byId("dock").contains(document.activeElement)) dock.show("");
	else if (inspector.isOpen) go([]);
	else if (dock.open) dock.show("");
}

/** Move the focus along a toolbar by an arrow key; returns whether the key was one. */
function moveInToolbar(event) {
	const bar = event.target.closest("[role=toolbar]");
	const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
	if (!bar || !by || event.target.closest("[popover]")) return false;
	const buttons = [...bar.querySelectorAll("button:enabled")]
		.filter((button) => button.offsetParent && !button.closest("[popover]"));
	const at = buttons.indexOf(event.target);
	buttons[(at + by + buttons.length) % buttons.length]?.focus();
	event.preventDefault();
	return true;
}

/** Tell whether a key belongs to the control that has the focus. */
function isTyping({ target, key }) {
	if (target.closest("select, input:not([type=checkbox], [type=range])")) return true;
	const usesArrows = target.closest("input[type=range], .lines");
	if (usesArrows && (key.startsWith("Arrow") || key === " ")) return true;
	return key === " " && Boolean(target.closest("button, summary, input, a"));
}

function helpSection([title, rows]) {
	return element("section", {}, element("h3", {}, title), element("dl", {},
		...rows.flatMap(([keys, text]) => [
			element("dt", {}, ...keys.split(" ").map((key) => element("kbd", {}, key))),
			element("dd", {}, text)])));
}
