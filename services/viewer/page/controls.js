// One parameter as a control, by its description: a box to tick, a choice, a slider with a number,
// or a text. A change is sent at once, one at a time, the newest next.

import { element, mark, say } from "./elements.js";
import { bend, placeOf, STEPS, typed, valueAt } from "./scale.js";

export class Control {
	/** `change(value)` sends a change and resolves to the reply {ok, error, allowed}. */
	constructor(parameter, change) {
		this.change = change;
		this.busy = false;
		this.next = undefined;
		this.parameter = parameter;
		this.build();
		this.show();
	}

	update(parameter) {
		this.parameter = parameter;
		if (!this.busy) this.show();
	}

	build() {
		const { node, name, unit, description } = this.parameter;
		const id = `parameter-${node}-${name}`;
		this.inputs = this.makeInputs(id);
		this.error = element("p", { class: "refusal", id: `${id}-error`, role: "alert", hidden: true });
		this.reset = element("button", { type: "button", class: "reset", title: "Back to the default",
			"aria-label": `${name} back to the default`,
			onclick: () => this.send(this.parameter.default) }, "↺");
		this.element = element("div", { class: "parameter", title: this.tooltip(), "data-name": name },
			element("label", { for: id }, name, unit ? element("small", {}, unit) : null),
			element("div", { class: "inputs" }, ...this.inputs.parts),
			this.reset,
			element("p", { class: "description", id: `${id}-words` }, description),
			this.error);
	}

	makeInputs(id) {
		const { type, choices, minimum, maximum } = this.parameter;
		const common = { id, "aria-describedby": `${id}-words ${id}-error` };
		if (type === "bool") {
			const box = element("input", { ...common, type: "checkbox",
				onchange: () => this.send(box.checked) });
			return { parts: [box], show: (value) => { box.checked = Boolean(value); } };
		}
		if (choices) return this.choice(common, choices);
		if (type === "str") {
			const text = element("input", { ...common, type: "text", autocomplete: "off",
				spellcheck: "false", onchange: () => this.send(typed(this.parameter, text.value)) });
			return { parts: [text], show: (value) => { text.value = value ?? ""; } };
		}
		return this.number(common, minimum !== null && maximum !== null);
	}

	choice(common, choices) {
		const listed = this.parameter.default === null ? ["", ...choices] : choices;
		const list = element("select", { ...common,
			onchange: () => this.send(typed(this.parameter, list.value)) },
		...listed.map((choice) => element("option", { value: choice }, choice || "not set")));
		return { parts: [list], show: (value) => { list.value = String(value ?? ""); } };
	}

	number(common, hasRange) {
		const { name, type, default: usual, minimum, maximum } = this.parameter;
		const field = element("input", { ...common, type: "number", inputmode: "decimal",
			min: minimum, max: maximum, step: type === "int" ? 1 : "any",
			placeholder: usual === null ? "not set" : "",
			onchange: () => this.send(typed(this.parameter, field.value)) });
		if (!hasRange) return { parts: [field], show: (value) => { field.value = value ?? ""; } };
		const slider = element("input", { type: "range", min: 0, max: STEPS, step: 1,
			"aria-label": `${name}, slider`,
			oninput: () => {
				const value = valueAt(this.parameter, Number(slider.value));
				slider.setAttribute("aria-valuetext", String(value));
				field.value = value;
				this.send(value);
			} });
		mark(slider, "bent", bend(this.parameter) !== 1);
		return {
			parts: [slider, field],
			show: (value) => {
				field.value = value ?? "";
				// Several places may mean the same value; then the slider stays where it is.
				if (valueAt(this.parameter, Number(slider.value)) !== value) {
					slider.value = placeOf(this.parameter, value ?? usual ?? minimum);
				}
				slider.setAttribute("aria-valuetext", value === null ? "not set" : String(value));
			},
		};
	}

	async send(value) {
		this.next = value;
		if (this.busy) return;
		this.busy = true;
		let reply = { ok: true };
		while (this.next !== undefined) {
			const wanted = this.next;
			this.next = undefined;
			reply = await this.change(wanted);
		}
		this.busy = false;
		this.refused(reply);
		this.show();
	}

	refused(reply) {
		const words = reply.ok ? ""
			: `${reply.error}${reply.allowed ? `. Allowed: ${reply.allowed}` : ""}`;
		this.error.hidden = !words;
		say(this.error, words);
		this.inputs.parts.at(-1).setAttribute("aria-invalid", String(!reply.ok));
	}

	show() {
		const { value, default: usual } = this.parameter;
		this.inputs.show(value);
		this.reset.disabled = value === usual;
		mark(this.element, "changed", value !== usual);
		mark(this.element, "value", value);
	}

	tooltip() {
		const { description, minimum, maximum, choices, unit, default: usual } = this.parameter;
		const range = choices ? choices.join(", ")
			: minimum !== null && maximum !== null ? `${minimum} to ${maximum}` : "";
		return [description, range && `allowed: ${range}${unit ? ` ${unit}` : ""}`,
			`default: ${usual === null ? "not set" : usual}`].filter(Boolean).join("\n");
	}
}
