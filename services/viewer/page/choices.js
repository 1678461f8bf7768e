// The large view's two menus: what is drawn over the picture, and what stands beside it.

import { byId, element } from "./elements.js";
import { inOrder, overlayStreams, topicName } from "./naming.js";
import { recall, remember } from "./preferences.js";

export class Choices {
	/** `changed()` is called after each choice; `beside(keys)` with what shall stand beside. */
	constructor(system, changed, beside) {
		Object.assign(this, { system, changed, beside });
		this.drawn = recall("overlays", {});
		this.isOn = recall("overlayOn", true);
		this.trails = recall("trails", true);
		this.onlyComplete = recall("onlyComplete", false);
	}

	overlayKeys(camera) {
		if (!this.isOn) return [];
		return overlayStreams(this.system.streams, camera)
			.filter((stream) => this.isDrawn(stream)).map((stream) => stream.key);
	}

	toggleAll() {
		this.isOn = !this.isOn;
		remember("overlayOn", this.isOn);
		this.changed();
	}

	/** Write both menus for the streams that are there now; `keys` stand in the view. */
	write(keys, camera) {
		const overlays = overlayStreams(this.system.streams, camera);
		const others = inOrder(this.system.streams).filter((stream) => stream.camera === camera);
		const state = JSON.stringify([keys, [...overlays, ...others].map((one) => one.key),
			this.drawn, this.trails, this.onlyComplete]);
		if (state === this.state) return;
		this.state = state;
		fill(byId("overlay-menu"), [
			...overlays.map((stream) => check(stream.topic, this.isDrawn(stream),
				(on) => this.draw(stream, on))),
			overlays.length ? null : element("p", {}, "This camera has no centroid and no tracks."),
			element("hr"),
			check("trails of 2 s", this.trails, (on) => this.set("trails", on)),
			check("only frames with their overlay", this.onlyComplete,
				(on) => this.set("onlyComplete", on),
				"The picture then waits longer for its messages, and is dropped if they do not come"),
		]);
		fill(byId("beside-menu"), others.map((stream) => check(topicName(stream),
			keys.includes(stream.key), (on) => this.stand(keys, stream.key, on))));
	}

	/** Unless the user chose: the centroid, and of the tracks the tracker's before the truth. */
	isDrawn(stream) {
		const chosen = this.drawn[stream.topic];
		if (chosen !== undefined) return chosen;
		if (stream.topic !== "truth") return true;
		return !this.system.streams.some((other) => other.camera === stream.camera
			&& other.topic === "tracks");
	}

	draw(stream, on) {
		this.drawn[stream.topic] = on;
		remember("overlays", this.drawn);
		this.changed();
	}

	set(name, on) {
		this[name] = on;
		remember(name, on);
		this.changed();
	}

	stand(keys, key, on) {
		const next = on ? [...keys, key] : keys.filter((other) => other !== key);
		if (next.length) this.beside(next);
		else this.changed();
	}
}

function check(words, checked, chosen, title = null) {
	return element("label", { title },
		element("input", { type: "checkbox", checked, "data-choice": words,
			onchange: (event) => chosen(event.target.checked) }),
		element("span", {}, words));
}

function fill(menu, rows) {
	const focused = document.activeElement?.dataset?.choice;
	const had = menu.contains(document.activeElement);
	menu.replaceChildren(...rows.filter(Boolean));
	if (had && focused) menu.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus();
}

/** A menu closes when something else is clicked, or at Escape. */
export function closeMenus(except = null) {
	let closed = false;
	for (const menu of document.querySelectorAll("details.menu[open]")) {
		if (menu === except) continue;
		if (menu.contains(document.activeElement)) menu.querySelector("summary").focus();
		menu.open = false;
		closed = true;
	}
	return closed;
}

document.addEventListener("pointerdown", (event) => {
	closeMenus(event.target.closest("details.menu"));
});
