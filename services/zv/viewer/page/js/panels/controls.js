// The control of one parameter, by its description: a checkbox, a choice, a slider with a number,
// or a text. Changes are sent at once, but one at a time: after the reply, the newest is sent.
//
// Ranges are often much wider than the useful values (0 to 100 000 with a default of 40). Such a
// slider is not linear, so that the default is at 40 % of its length and small values can be chosen
// precisely.

import { element, setData, setText } from "../ui/elements.js";

export const STEPS = 1000;
const DEFAULT_AT = 0.4;
const MOST_BENT = 12;
const WIDE = 1000;

/** The exponent of a parameter's slider: 1 for a linear one. */
export function bend({ minimum, maximum, default: usual }) {
	const share = typeof usual === "number" ? (usual - minimum) / (maximum - minimum) : 0;
	if (share <= 0 || share >= 1) return maximum - minimum > WIDE ? 3 : 1;
	if (share > 0.1) return 1;
	return Math.min(MOST_BENT, Math.log(share) / Math.log(DEFAULT_AT));
}

/** The value at a slider's position, 0 to `STEPS`. */
export function valueAt(parameter, position) {
	const { minimum, maximum, type } = parameter;
	const value = minimum + (maximum - minimum) * (position / STEPS) ** bend(parameter);
	if (type === "int") {
		const step = parameter.step ?? 1;
		return Math.min(maximum, minimum + Math.round((value - minimum) / step) * step);
	}
	const fine = Number(value.toPrecision(3));
	return Math.min(maximum, Math.max(minimum, fine));
}

export function positionOf(parameter, value) {
	const { minimum, maximum } = parameter;
	if (typeof value !== "number") return 0;
	const share = Math.min(1, Math.max(0, (value - minimum) / (maximum - minimum)));
	return Math.round(STEPS * share ** (1 / bend(parameter)));
}

/** A control's text as a value of the parameter's type; null for empty text, if that is allowed. */
export function parse(parameter, text) {
	if (text === "" && parameter.default === null) return null;
	const isNumber = ["int", "float"].includes(parameter.type) && text.trim() !== "";
	return isNumber && !Number.isNaN(Number(text)) ? Number(text) : text;
}

/** Why a parameter cannot be set now, by its flags; empty if it can. */
export function locked({ flags }) {
	const words = { read_only: "only read", inactive: "without effect now", grabbed: "locked now" };
	return (flags ?? []).map((flag) => words[flag]).filter(Boolean).join(", ");
}

/** Show why a change was refused and what is allowed, or nothing if it was not. */
export function showRefusal(target, { ok, error = "", allowed = "" }) {
	setText(target, ok ? "" : [error, allowed].filter(Boolean).join(". Allowed: "));
}

export class Control {
	/** `change(value)` sends a change and resolves to the reply {ok, error, allowed}. */
	constructor(parameter, change) {
		const { node, name, unit, description } = parameter;
		const id = `parameter-${node}-${name}`;
		this.parameter = parameter;
		this.change = change;
		this.busy = false;
		this.edited = false;
		this.field = this.makeField({ id, "aria-describedby": `${id}-words ${id}-error`,
			oninput: () => this.edited = true,
			onblur: () => this.endEdit(),
			onchange: ({ target }) => {
				this.edited = false;
				this.send(target.type === "checkbox" ? target.checked : parse(this.parameter, target.value));
			} });
		this.slider = this.makeSlider();
		this.condition = element("p", { class: "condition" });
		this.error = element("p", { class: "refusal", id: `${id}-error`, role: "alert" });
		this.reset = element("button", { type: "button", class: "reset", title: "Back to the default",
			"aria-label": `${name} back to the default`,
			onclick: () => this.send(this.parameter.default) }, "↺");
		this.element = element("div", { class: "parameter", "data-name": name },
			element("label", { for: id }, name, unit ? element("small", {}, unit) : null),
			element("div", { class: "inputs" }, this.slider, this.field),
			this.reset,
			this.condition,
			element("p", { class: "description", id: `${id}-words` }, description),
			this.error);
		this.settle({ ok: true });
	}

	/** Show the parameter's value again, after a typed text was discarded. */
	endEdit() {
		if (!this.edited) return;
		this.edited = false;
		if (!this.busy) this.settle({ ok: true });
	}

	/** Show the value that the node has, and why it refused another, if it did. */
	settle(reply) {
		showRefusal(this.error, reply);
		this.field.setAttribute("aria-invalid", String(!reply.ok));
		const { value, default: usual } = this.parameter;
		this.show(value);
		const words = locked(this.parameter);
		for (const input of [this.field, this.slider]) if (input) input.disabled = words !== "";
		this.element.title = this.tooltip();
		this.reset.disabled = value === usual || words !== "";
		setData(this.element, { locked: words, changed: value !== usual, value });
	}

	/**
	 * Show a new value, unless it is the known one, or a change is pending; `words` say on which choice
	 * of another parameter this one depends, if it has no effect now.
	 */
	update(parameter, words) {
		setText(this.condition, words);
		setData(this.element, { unused: words !== "" });
		if (parameter === this.parameter) return;
		this.parameter = parameter;
		if (!this.busy) this.settle({ ok: true });
	}

	makeField(common) {
		const { type, choices, minimum, maximum, default: usual } = this.parameter;
		if (choices) {
			const listed = usual === null ? ["", ...choices] : choices;
			return element("select", common,
				...listed.map((choice) => new Option(choice || "not set", choice)));
		}
		if (this.parameter.flags?.includes("write_only")) {
			return element("button", { ...common, type: "button", onchange: null,
				onclick: () => this.send(true) }, "Do");
		}
		if (type === "bool") return element("input", { ...common, type: "checkbox" });
		if (type === "str") {
			return element("input", { ...common, type: "text", autocomplete: "off", spellcheck: "false" });
		}
		return element("input", { ...common, type: "number", inputmode: "decimal", min: minimum,
			max: maximum, step: type === "int" ? this.parameter.step ?? 1 : "any",
			placeholder: usual === null ? "not set" : "" });
	}

	/** Make the slider of a number with both limits, else null. */
	makeSlider() {
		const { name, minimum, maximum } = this.parameter;
		if (this.field.type !== "number" || minimum === null || maximum === null) return null;
		return element("input", { type: "range", min: 0, max: STEPS, step: 1,
			"aria-label": `${name}, slider`,
			oninput: ({ target }) => {
				const value = valueAt(this.parameter, Number(target.value));
				this.show(value);
				this.send(value);
			} });
	}

	/** Show a value; the field keeps a text that is being typed. */
	show(value) {
		const { field, slider, parameter } = this;
		if (field.type === "button") return;
		if (field.type === "checkbox") field.checked = Boolean(value);
		else if (!this.edited) field.value = String(value ?? "");
		// Several positions may mean the same value; then the slider stays where it is.
		if (slider && valueAt(parameter, Number(slider.value)) !== value) {
			slider.value = positionOf(parameter, value ?? parameter.default ?? parameter.minimum);
		}
		slider?.setAttribute("aria-valuetext", value === null ? "not set" : String(value));
	}

	async send(value) {
		this.next = value;
		if (this.busy) return;
		this.busy = true;
		let reply;
		while (this.next !== undefined) {
			const wanted = this.next;
			this.next = undefined;
			reply = await this.change(wanted);
		}
		this.busy = false;
		this.settle(reply);
	}

	tooltip() {
		const { description, minimum, maximum, choices, unit, default: usual } = this.parameter;
		const range = choices ? choices.join(", ")
			: minimum !== null && maximum !== null ? `${minimum} to ${maximum}` : "";
		return [description, range && `allowed: ${range}${unit ? ` ${unit}` : ""}`,
			locked(this.parameter), `default: ${usual === null ? "not set" : usual}`].filter(Boolean).join("\n");
	}
}
