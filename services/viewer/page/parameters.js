// The panel of parameters: each node's controls, its defaults, its settings as a file.

import { byId, element, inPlace, mark, say } from "./elements.js";
import { Control } from "./controls.js";
import { recall, remember } from "./preferences.js";
import { saveText } from "./saving.js";

export class ParametersPanel {
	/** `camera()` returns the camera that is looked at, or null. */
	constructor(system, connection, camera) {
		Object.assign(this, { system, connection, camera });
		this.sections = new Map();
		this.list = byId("parameters");
		system.on("parameters", ({ node }) => this.rebuild(node));
		system.on("parameter", ({ node, parameter }) => this.update(node, parameter));
		system.on("nodes", () => this.arrange());
		system.on("hello", () => this.arrange());
	}

	/** Put the nodes of the camera that is looked at first. */
	arrange() {
		const camera = this.camera();
		const cameras = (node) => this.node(node)?.cameras ?? [];
		const known = [...this.system.parameters.keys()];
		const first = (node) => (cameras(node).includes(camera) ? 0 : 1);
		known.sort((a, b) => first(a) - first(b) || a.localeCompare(b));
		for (const [node, section] of this.sections) {
			if (known.includes(node)) continue;
			section.element.remove();
			this.sections.delete(node);
		}
		for (const node of known) if (!this.sections.has(node)) this.rebuild(node);
		for (const [node, section] of this.sections) this.state(node, section);
		inPlace(this.list, known.map((node) => this.sections.get(node)?.element).filter(Boolean));
		byId("no-parameters").hidden = known.length > 0;
	}

	node(name) {
		return this.system.nodes.find((node) => node.node === name);
	}

	rebuild(node) {
		const parameters = this.system.parameters.get(node);
		if (!parameters?.size) return;
		const before = this.sections.get(node);
		const names = [...parameters.keys()].join();
		if (before && before.names === names) {
			for (const parameter of parameters.values()) this.update(node, parameter);
			return;
		}
		const controls = new Map([...parameters].map(([name, parameter]) => [name,
			new Control(parameter, (value) => this.set(node, { [name]: value }))]));
		const section = { controls, names, ...this.section(node, controls) };
		if (before) before.element.replaceWith(section.element);
		this.sections.set(node, section);
		this.arrange();
	}

	section(node, controls) {
		const state = element("span", { class: "node-state" });
		const remark = element("p", { class: "refusal", role: "alert", hidden: true });
		const service = this.node(node)?.service ?? node;
		const details = element("details", { class: "node-parameters", "data-node": node,
			open: recall(`open.${service}`, this.isOpenAtFirst(node)),
			ontoggle: () => remember(`open.${service}`, details.open) },
		element("summary", {}, element("b", {}, node), state),
		element("div", { class: "row" },
			element("button", { type: "button", onclick: () => this.defaults(node, remark) },
				"Reset to defaults"),
			element("button", { type: "button", onclick: () => this.save(node, remark) },
				"Save as TOML")),
		remark,
		...[...controls.values()].map((control) => control.element));
		return { element: details, state };
	}

	/** Few nodes: what one turns most is open. Many: only those of the camera looked at. */
	isOpenAtFirst(node) {
		const { service, cameras } = this.node(node) ?? {};
		const isNear = this.system.nodes.length <= 5 || cameras?.includes(this.camera());
		return service !== "camera" && isNear;
	}

	update(node, parameter) {
		const section = this.sections.get(node);
		const control = section?.controls.get(parameter.name);
		if (!control) {
			this.rebuild(node);
			return;
		}
		control.update(parameter);
		this.state(node, section);
	}

	state(node, section) {
		const isThere = this.node(node)?.alive ?? true;
		const changed = [...this.system.parameters.get(node)?.values() ?? []]
			.filter((parameter) => parameter.value !== parameter.default).length;
		mark(section.element, "alive", isThere);
		say(section.state, !isThere ? "gone" : changed ? `${changed} changed` : "");
	}

	set(node, values) {
		return this.connection.ask({ op: "set", node, values });
	}

	async defaults(node, remark) {
		const parameters = [...this.system.parameters.get(node)?.values() ?? []];
		const values = Object.fromEntries(parameters
			.filter((parameter) => parameter.value !== parameter.default)
			.map((parameter) => [parameter.name, parameter.default]));
		if (!Object.keys(values).length) return;
		this.remark(remark, await this.set(node, values));
	}

	async save(node, remark) {
		const reply = await this.connection.ask({ op: "dump", node });
		this.remark(remark, reply);
		if (reply.ok) saveText(reply.toml, `${node}.toml`);
	}

	remark(target, reply) {
		target.hidden = reply.ok;
		say(target, reply.ok ? "" : [reply.error, reply.allowed].filter(Boolean).join(". Allowed: "));
	}
}
