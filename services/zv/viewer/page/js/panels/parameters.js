// The panel of parameters: each node's controls, its defaults, its settings as a file.

import { offer } from "../export/saving.js";
import { byId, drawList, element, setData, setText } from "../ui/elements.js";
import { loadPreference, savePreference } from "../ui/preferences.js";
import { Control, locked, showRefusal } from "./controls.js";

/** Whether a text has no default that could be set: one of a device. */
const isKeptElsewhere = ({ name, default: usual }) => name.includes(".") && usual === null;

/**
 * Why a parameter has no effect now: its description begins with the choices of another one to which
 * it belongs, as in "robust: ..." or "of canny and sobel: ...", and that one is not among them. Empty
 * if it has.
 */
export function condition({ description }, parameters) {
	const words = /^(?:of )?([\w, ]{1,100}?)(?:, (?:their|its) [\w ]+)?:/.exec(description ?? "")?.[1];
	const values = words?.split(/, | and /) ?? [];
	const other = parameters.find(({ choices }) => choices && values.every((one) => choices.includes(one)));
	if (!words || !other || values.includes(other.value)) return "";
	return `only with ${other.name} = ${values.join(" or ")}`;
}

export class ParametersPanel {
	/** `current()` returns the camera in the large view, or null. */
	constructor(system, connection, current) {
		this.visible = false; // set by the dock
		this.system = system;
		this.connection = connection;
		this.current = current;
		system.on("parameters nodes streams hello", () => this.draw());
	}

	/** Whether this page may not change parameters. */
	get isViewOnly() {
		return this.system.hello?.scope === "view";
	}

	/** Show a section for each node, those of the camera in the large view first. */
	draw() {
		if (!this.visible) return;
		byId("view-only").hidden = !this.isViewOnly;
		const camera = this.current();
		const rank = (node) => (this.system.node(node)?.cameras?.includes(camera) ? 0 : 1);
		const known = [...this.system.parameters.keys()].filter((node) => this.of(node).length)
			.sort((a, b) => rank(a) - rank(b) || a.localeCompare(b))
			.map((node) => ({ node, key: [node, ...this.of(node).map(({ name }) => name)].join() }));
		drawList(byId("parameters"), known, ({ node }) => this.makeSection(node));
	}

	/** All parameters of a node. */
	of(node) {
		return [...this.system.parameters.get(node)?.values() ?? []];
	}

	/** The parameters that do not have their default values, and can be set. */
	changed(node) {
		return this.of(node).filter((parameter) =>
			parameter.value !== parameter.default && parameter.default !== undefined
				&& !locked(parameter) && !isKeptElsewhere(parameter));
	}

	/** Make a node's section: its element, and `update()`, which shows new values. */
	makeSection(node) {
		const controls = this.of(node).map((parameter) =>
			new Control(parameter, (value) => this.set(node, { [parameter.name]: value })));
		const state = element("span", { class: "node-state" });
		const refusal = element("p", { class: "refusal", role: "alert" });
		const fields = element("fieldset", {}, ...controls.map((control) => control.element));
		const reset = element("button", { type: "button",
			onclick: () => this.setDefaults(node, refusal) }, "Reset to defaults");
		const service = this.system.node(node)?.service ?? node;
		const details = element("details", { class: "node-parameters", "data-node": node,
			open: loadPreference(`open.${service}`, this.isOpenAtFirst(node)),
			ontoggle: () => savePreference(`open.${service}`, details.open) },
		element("summary", {}, element("b", {}, node), state),
		element("div", { class: "row" }, reset,
			element("button", { type: "button", onclick: () => this.save(node, refusal) },
				"Save as TOML")),
		refusal, fields);
		return { element: details, update: () => {
			const isAlive = this.system.node(node)?.alive ?? true;
			const changed = this.changed(node).length;
			setData(details, { alive: isAlive });
			fields.disabled = reset.disabled = this.isViewOnly;
			setText(state, !isAlive ? "gone" : changed ? `${changed} changed` : "");
			const all = this.of(node);
			controls.forEach((control, index) => control.update(all[index], condition(all[index], all)));
		} };
	}

	/** Few nodes: all but cameras are open. Many: only those of the camera in the large view. */
	isOpenAtFirst(node) {
		const { service, cameras } = this.system.node(node) ?? {};
		const isNear = this.system.nodes.length <= 5 || cameras?.includes(this.current());
		return service !== "camera" && isNear;
	}

	set(node, values) {
		return this.connection.request({ op: "set", node, values });
	}

	async setDefaults(node, refusal) {
		const values = this.changed(node).map((parameter) => [parameter.name, parameter.default]);
		if (values.length) showRefusal(refusal, await this.set(node, Object.fromEntries(values)));
	}

	async save(node, refusal) {
		const reply = await this.connection.request({ op: "dump", node });
		showRefusal(refusal, reply);
		if (reply.ok) offer([reply.toml], "text/plain", `${node}.toml`);
	}
}
