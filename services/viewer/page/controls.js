// One parameter as a control, by its description: a box to tick, a choice, a slider with a number,
// or a text. A change is sent at once, one at a time, the newest next.

import { element, mark, say } from "./elements.js";
import { bend, placeOf, STEPS, stepOf, typed, valueAt } from "./scale.js";

const FLASH_MS = 1200;

export class Control {
  /** `change(value)` sends a change and resolves to the reply {ok, error, allowed}. */
  constructor(parameter, change) {
    this._change = change;
    this._busy = false;
    this._next = undefined;
    this._parameter = parameter;
    this._build();
    this._show();
  }

  /** Take what the node says of this parameter now, changed here or by others. */
  update(parameter) {
    const isOther = parameter.value !== this._parameter.value;
    this._parameter = parameter;
    if (this._busy) return;
    this._show();
    if (isOther) this._flash();
  }

  get value() {
    return this._parameter.value;
  }

  _build() {
    const { node, name, unit, description } = this._parameter;
    const id = `parameter-${node}-${name}`;
    this._inputs = this._makeInputs(id);
    this._error = element("p", { class: "refusal", id: `${id}-error`, role: "alert", hidden: true });
    this._reset = element("button", { type: "button", class: "reset", title: "Back to the default",
      "aria-label": `${name} back to the default`,
      onclick: () => this._send(this._parameter.default) }, "↺");
    this.element = element("div", { class: "parameter", title: this._tooltip(), "data-name": name },
      element("label", { for: id }, name, unit ? element("small", {}, unit) : null),
      element("div", { class: "inputs" }, ...this._inputs.parts),
      this._reset,
      element("p", { class: "description", id: `${id}-words` }, description),
      this._error);
  }

  _makeInputs(id) {
    const { type, choices, minimum, maximum } = this._parameter;
    const common = { id, "aria-describedby": `${id}-words ${id}-error` };
    if (type === "bool") {
      const box = element("input", { ...common, type: "checkbox",
        onchange: () => this._send(box.checked) });
      return { parts: [box], show: (value) => { box.checked = Boolean(value); } };
    }
    if (choices) return this._choice(common, choices);
    if (type === "str") {
      const text = element("input", { ...common, type: "text", autocomplete: "off",
        spellcheck: "false", onchange: () => this._send(typed(this._parameter, text.value)) });
      return { parts: [text], show: (value) => { text.value = value ?? ""; } };
    }
    return this._number(common, minimum !== null && maximum !== null);
  }

  _choice(common, choices) {
    const listed = this._parameter.default === null ? ["", ...choices] : choices;
    const list = element("select", { ...common,
      onchange: () => this._send(typed(this._parameter, list.value)) },
    ...listed.map((choice) => element("option", { value: choice }, choice || "not set")));
    return { parts: [list], show: (value) => { list.value = String(value ?? ""); } };
  }

  _number(common, hasRange) {
    const { name, default: usual, minimum, maximum } = this._parameter;
    const field = element("input", { ...common, type: "number", inputmode: "decimal",
      min: minimum, max: maximum, step: stepOf({ ...this._parameter, minimum, maximum }),
      placeholder: usual === null ? "not set" : "",
      onchange: () => this._send(typed(this._parameter, field.value)) });
    if (!hasRange) return { parts: [field], show: (value) => { field.value = value ?? ""; } };
    const slider = element("input", { type: "range", min: 0, max: STEPS, step: 1,
      "aria-label": `${name}, slider`,
      oninput: () => {
        const value = this._slid(Number(slider.value));
        slider.setAttribute("aria-valuetext", String(value));
        field.value = value;
        this._send(value);
      } });
    mark(slider, "bent", bend(this._parameter) !== 1);
    return {
      parts: [slider, field],
      show: (value) => {
        field.value = value ?? "";
        slider.value = placeOf(this._parameter, value ?? usual ?? minimum);
        slider.setAttribute("aria-valuetext", value === null ? "not set" : String(value));
      },
    };
  }

  /** The slider's value; an arrow key always changes it, though its step were less than 1. */
  _slid(place) {
    const found = valueAt(this._parameter, place);
    const held = this._next ?? this._parameter.value;
    if (this._parameter.type !== "int" || found !== held || typeof held !== "number") return found;
    const towards = Math.sign(place - placeOf(this._parameter, held));
    return Math.min(this._parameter.maximum, Math.max(this._parameter.minimum, held + towards));
  }

  async _send(value) {
    this._next = value;
    if (this._busy) return;
    this._busy = true;
    let reply = { ok: true };
    while (this._next !== undefined) {
      const wanted = this._next;
      this._next = undefined;
      reply = await this._change(wanted);
    }
    this._busy = false;
    this._refused(reply);
    this._show();
  }

  _refused(reply) {
    const words = reply.ok ? ""
      : `${reply.error}${reply.allowed ? `. Allowed: ${reply.allowed}` : ""}`;
    this._error.hidden = !words;
    say(this._error, words);
    this._inputs.parts.at(-1).setAttribute("aria-invalid", String(!reply.ok));
  }

  _show() {
    const { value, default: usual } = this._parameter;
    this._inputs.show(value);
    this._reset.disabled = value === usual;
    mark(this.element, "changed", value !== usual);
    mark(this.element, "value", value);
  }

  _flash() {
    this.element.classList.add("flash");
    clearTimeout(this._flashTimer);
    this._flashTimer = setTimeout(() => this.element.classList.remove("flash"), FLASH_MS);
  }

  _tooltip() {
    const { description, minimum, maximum, choices, unit, default: usual } = this._parameter;
    const range = choices ? choices.join(", ")
      : minimum !== null && maximum !== null ? `${minimum} to ${maximum}` : "";
    return [description, range && `allowed: ${range}${unit ? ` ${unit}` : ""}`,
      `default: ${usual === null ? "not set" : usual}`].filter(Boolean).join("\n");
  }
}
