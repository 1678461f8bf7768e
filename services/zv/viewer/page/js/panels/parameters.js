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

/** The panel; `current()` returns the camera in the large view, or null. */
export function parametersPanel(system, connection, current) {
	const panel = { visible: false, draw }; // set by the dock
	const isViewOnly = () => system.hello?.scope === "view";
	const set = (node, values) => connection.request({ op: "set", node, values });

	/** Show a section for each node, those of the camera in the large view first. */
	function draw() {
		if (!panel.visible) return;
		byId("view-only").hidden = !isViewOnly();
		const camera = current();
		const rank = (node) => (system.node(node)?.cameras?.includes(camera) ? 0 : 1);
		const known = [...system.parameters.keys()].filter((node) => parametersOf(node).length)
			.sort((a, b) => rank(a) - rank(b) || a.localeCompare(b))
			.map((node) => ({ node, key: [node, ...parametersOf(node).map(({ name }) => name)].join() }));
		drawList(byId("parameters"), known, ({ node }) => makeSection(node));
	}

	function parametersOf(node) {
		return [...system.parameters.get(node)?.values() ?? []];
	}

	/** The parameters that do not have their default values, and can be set. */
	function changedOf(node) {
		return parametersOf(node).filter((parameter) =>
			parameter.value !== parameter.default && parameter.default !== undefined
				&& !locked(parameter) && !isKeptElsewhere(parameter));
	}

	/** Make a node's section: its element, and `update()`, which shows new values. */
	function makeSection(node) {
		const controls = parametersOf(node).map((parameter) =>
			new Control(parameter, (value) => set(node, { [parameter.name]: value })));
		const state = element("span", { class: "node-state" });
		const refusal = element("p", { class: "refusal", role: "alert" });
		const fields = element("fieldset", {}, ...controls.map((control) => control.element));
		const reset = element("button", { type: "button",
			onclick: () => setDefaults(node, refusal) }, "Reset to defaults");
		const service = system.node(node)?.service ?? node;
		const details = element("details", { class: "node-parameters", "data-node": node,
			open: loadPreference(`open.${service}`, isOpenAtFirst(node)),
			ontoggle: () => savePreference(`open.${service}`, details.open) },
		element("summary", {}, element("b", {}, node), state),
		element("div", { class: "row" }, reset,
			element("button", { type: "button", onclick: () => save(node, refusal) }, "Save as TOML")),
		refusal, fields);
		return { element: details, update: () => {
			const isAlive = system.node(node)?.alive ?? true;
			const changed = changedOf(node).length;
			setData(details, { alive: isAlive });
			fields.disabled = reset.disabled = isViewOnly();
			setText(state, !isAlive ? "gone" : changed ? `${changed} changed` : "");
			const all = parametersOf(node);
			controls.forEach((control, index) => control.update(all[index], condition(all[index], all)));
		} };
	}

	/** Few nodes: all but cameras are open. Many: only those of the camera in the large view. */
	function isOpenAtFirst(node) {
		const { service, cameras } = system.node(node) ?? {};
		const isNear = system.nodes.length <= 5 || cameras?.includes(current());
		return service !== "camera" && isNear;
	}

	async function setDefaults(node, refusal) {
		const values = changedOf(node).map((parameter) => [parameter.name, parameter.default]);
		if (values.length) showRefusal(refusal, await set(node, Object.fromEntries(values)));
	}

	async function save(node, refusal) {
		const reply = await connection.request({ op: "dump", node });
		showRefusal(refusal, reply);
		if (reply.ok) offer([reply.toml], "text/plain", `${node}.toml`);
	}

	system.on("parameters nodes streams hello", draw);
	return panel;
}
