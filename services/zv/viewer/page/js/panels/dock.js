// The dock beside the main view: which panel is open. Also the list of cameras that panels share.

import { byId, listen, setData, setOptions, setText } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";

// Kinds of text that each panel needs besides the lists. The count of health is always visible.
const NEEDS = { parameters: ["parameters"], graph: ["matches"], log: ["log"] };

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
		for (const other of Object.keys(this.panels)) {
			const section = byId(`panel-${other}`);
			section.hidden = other !== this.open;
			if (other === this.open) setText(byId("dock-title"), section.dataset.title);
		}
		this.draw();
		for (const button of this.buttons) {
			button.setAttribute("aria-expanded", String(button.dataset.panel === this.open));
		}
		if (!this.open && hadFocus) {
			this.buttons.find((button) => button.dataset.panel === closed)?.focus();
		}
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

/** A list of the present cameras, which follows the one that the large view shows. */
export class CameraList {
	/** `current()` returns the camera in the large view, or null; `changed()` is called on choice. */
	constructor(list, system, current, changed, { withAll = false } = {}) {
		this.list = list;
		this.system = system;
		this.current = current;
		this.withAll = withAll;
		this.before = null;
		list.addEventListener("change", changed);
	}

	/** The chosen camera; empty for all. */
	get camera() {
		return this.list.value;
	}

	/** Offer the present cameras; choose the one in the large view if that changed. */
	update() {
		const cameras = [...this.system.cameras, ...(this.withAll ? [""] : [])];
		const current = this.current();
		const wanted = current && current !== this.before ? current : this.list.value;
		setOptions(this.list, cameras.map((camera) => [camera, camera || "all cameras"]));
		this.before = current;
		const value = cameras.includes(wanted) ? wanted : cameras[0];
		if (this.list.value !== value) this.list.value = value;
	}
}
