// The dock: which panel is open.

import { byId, mark, say } from "./elements.js";
import { recall, remember } from "./preferences.js";

export class Panels {
	/** `panels`: name -> object with `show(visible)`. */
	constructor(panels) {
		this.panels = panels;
		this.open = "";
		for (const button of this.buttons()) {
			button.addEventListener("click", () => this.toggle(button.dataset.panel));
		}
		byId("dock-close").addEventListener("click", () => this.show(""));
		this.show(matchMedia("(min-width: 1000px)").matches ? recall("panel", "") : "");
	}

	toggle(name) {
		this.show(name === this.open ? "" : name);
	}

	/** Open a panel; "" closes. The focus goes where it makes sense. */
	show(name) {
		const closed = this.open;
		this.open = name in this.panels ? name : "";
		const hadFocus = byId("dock").contains(document.activeElement);
		byId("dock").hidden = !this.open;
		mark(document.body, "panel", this.open);
		for (const [other, panel] of Object.entries(this.panels)) {
			const section = byId(`panel-${other}`);
			section.hidden = other !== this.open;
			if (other === this.open) say(byId("dock-title"), section.dataset.title);
			panel.show?.(other === this.open);
		}
		for (const button of this.buttons()) {
			button.setAttribute("aria-expanded", String(button.dataset.panel === this.open));
		}
		if (!this.open && hadFocus) {
			this.buttons().find((button) => button.dataset.panel === closed)?.focus();
		}
		remember("panel", this.open);
	}

	buttons() {
		return [...byId("panels").querySelectorAll("button")];
	}
}
