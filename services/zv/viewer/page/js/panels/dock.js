// The dock beside the main view: which panel is open. Also the lists that panels share: of cameras
// and of lines.

import { byId, drawList, later, listen, setData, setOptions, setText } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";

// Kinds of text that each panel needs besides the lists. The count of health is always visible.
const NEEDS = { parameters: ["parameters"], graph: ["matches"], log: ["log"] };

const AT_END_PX = 24;
const DRAW_MS = 200; // one drawing for the lines of a busy system

export class Dock {
	/**
	 * `panels`: name -> object with `draw()`, whose `visible` is set while the panel is open and the
	 * page is not hidden. `need(kinds)` is called with the kinds of text that the open panel needs.
	 */
	constructor(panels, need) {
		this.panels = panels;
		this.need = need;
		this.open = "";
		this.buttons = [...byId("panels").querySelectorAll("button")];
		for (const button of this.buttons) {
			button.addEventListener("click", () => this.toggle(button.dataset.panel));
		}
		listen("dock-close", "click", () => this.show(""));
		document.addEventListener("visibilitychange", () => this.draw());
		this.show(matchMedia("(min-width: 1000px)").matches ? loadPreference("panel", "") : "");
	}

	toggle(name) {
		this.show(name === this.open ? "" : name);
	}

	/**
	 * Open a panel; "" closes it. If the closed panel had the focus, its button gets the focus. The
	 * choice is kept in the browser unless it comes from a URL.
	 */
	show(name, { isKept = true } = {}) {
		const closed = this.open;
		this.open = Object.hasOwn(this.panels, name) ? name : "";
		const hadFocus = byId("dock").contains(document.activeElement);
		byId("dock").hidden = !this.open;
		setData(document.body, { panel: this.open });
		for (const each of Object.keys(this.panels)) byId(`panel-${each}`).hidden = each !== this.open;
		if (this.open) setText(byId("dock-title"), byId(`panel-${this.open}`).dataset.title);
		this.draw();
		const buttonOf = (panel) => this.buttons.find(({ dataset }) => dataset.panel === panel);
		for (const button of this.buttons) button.ariaExpanded = String(button === buttonOf(this.open));
		if (!this.open && hadFocus) buttonOf(closed)?.focus();
		if (isKept) savePreference("panel", this.open);
	}

	/** Draw the open panel and stop the others; stop all while the page is hidden. */
	draw() {
		this.need(document.hidden ? [] : ["health", ...NEEDS[this.open] ?? []]);
		for (const [name, panel] of Object.entries(this.panels)) {
			panel.visible = name === this.open && !document.hidden;
			panel.draw();
		}
	}
}

/**
 * Let a list offer the present cameras. `current()` returns the camera in the large view, or null;
 * `changed()` is called on choice. Returns a function that updates the list and returns the chosen
 * camera, empty for all: the one in the large view if that changed.
 */
export function cameraList(list, system, current, changed, { withAll = false } = {}) {
	let before = null;
	list.addEventListener("change", changed);
	return () => {
		const cameras = [...system.cameras, ...(withAll ? [""] : [])];
		const large = current();
		const wanted = large && large !== before ? large : list.value;
		setOptions(list, cameras.map((camera) => [camera, camera || "all cameras"]));
		before = large;
		const value = cameras.includes(wanted) ? wanted : cameras[0];
		if (list.value !== value) list.value = value;
		return list.value;
	};
}

/**
 * Draw lines, newest last, in a list that scrolls along only while its end is visible. `lines()`
 * returns them, each with a `key`; `make(line)` makes the element of one.
 */
export function lineList(id, lines, make) {
	const list = byId(id);
	let isClosed = true; // with its panel

	function draw() {
		const wasClosed = isClosed;
		isClosed = !list.clientHeight;
		if (isClosed) return;
		const atEnd = wasClosed || list.scrollHeight - list.scrollTop - list.clientHeight < AT_END_PX;
		drawList(list, lines(), (line) => ({ element: make(line) }));
		if (atEnd) list.scrollTop = list.scrollHeight;
	}

	return { draw, drawSoon: later(draw, DRAW_MS) };
}
