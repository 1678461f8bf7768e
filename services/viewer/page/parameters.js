// The panel of parameters: each node's controls, its defaults, its settings as a file.

import { byId, element, mark, say } from "./elements.js";
import { Control } from "./controls.js";
import { recall, remember } from "./preferences.js";
import { saveText } from "./saving.js";

export class ParametersPanel {
  /** `camera()` returns the camera that is looked at, or null. */
  constructor(system, connection, camera) {
    this._system = system;
    this._connection = connection;
    this._camera = camera;
    this._sections = new Map();
    this._list = byId("parameters");
    system.on("parameters", ({ node }) => this._rebuild(node));
    system.on("parameter", ({ node, parameter }) => this._update(node, parameter));
    system.on("nodes", () => this.arrange());
    system.on("hello", () => this.arrange());
  }

  /** Put the nodes of the camera that is looked at first. */
  arrange() {
    const camera = this._camera();
    const cameras = (node) => this._node(node)?.cameras ?? [];
    const known = [...this._system.parameters.keys()];
    const first = (node) => (cameras(node).includes(camera) ? 0 : 1);
    known.sort((a, b) => first(a) - first(b) || a.localeCompare(b));
    for (const [node, section] of this._sections) {
      if (known.includes(node)) continue;
      section.element.remove();
      this._sections.delete(node);
    }
    known.forEach((node, index) => {
      if (!this._sections.has(node)) this._rebuild(node);
      const section = this._sections.get(node);
      if (this._list.children[index] !== section.element) {
        this._list.insertBefore(section.element, this._list.children[index] ?? null);
      }
      this._state(node, section);
    });
    byId("no-parameters").hidden = known.length > 0;
  }

  _node(name) {
    return this._system.nodes.find((node) => node.node === name);
  }

  _rebuild(node) {
    const parameters = this._system.parameters.get(node);
    if (!parameters?.size) return;
    const before = this._sections.get(node);
    const names = [...parameters.keys()].join();
    if (before && before.names === names) {
      for (const parameter of parameters.values()) this._update(node, parameter);
      return;
    }
    const controls = new Map([...parameters].map(([name, parameter]) => [name,
      new Control(parameter, (value) => this._set(node, { [name]: value }))]));
    const section = { controls, names, ...this._section(node, controls) };
    if (before) before.element.replaceWith(section.element);
    this._sections.set(node, section);
    this.arrange();
  }

  _section(node, controls) {
    const state = element("span", { class: "node-state" });
    const remark = element("p", { class: "refusal", role: "alert", hidden: true });
    const service = this._node(node)?.service ?? node;
    const details = element("details", { class: "node-parameters", "data-node": node,
      open: recall(`open.${service}`, this._isOpenAtFirst(node)),
      ontoggle: () => remember(`open.${service}`, details.open) },
    element("summary", {}, element("b", {}, node), state),
    element("div", { class: "row" },
      element("button", { type: "button", onclick: () => this._defaults(node, remark) },
        "Reset to defaults"),
      element("button", { type: "button", onclick: () => this._save(node, remark) },
        "Save as TOML")),
    remark,
    ...[...controls.values()].map((control) => control.element));
    return { element: details, state };
  }

  /** Few nodes: what one turns most is open. Many: only those of the camera looked at. */
  _isOpenAtFirst(node) {
    const { service, cameras } = this._node(node) ?? {};
    const isNear = this._system.nodes.length <= 5 || cameras?.includes(this._camera());
    return service !== "camera" && isNear;
  }

  _update(node, parameter) {
    const section = this._sections.get(node);
    const control = section?.controls.get(parameter.name);
    if (!control) {
      this._rebuild(node);
      return;
    }
    control.update(parameter);
    this._state(node, section);
  }

  _state(node, section) {
    const isThere = this._node(node)?.alive ?? true;
    const changed = [...this._system.parameters.get(node)?.values() ?? []]
      .filter((parameter) => parameter.value !== parameter.default).length;
    mark(section.element, "alive", isThere);
    say(section.state, !isThere ? "gone" : changed ? `${changed} changed` : "");
  }

  _set(node, values) {
    return this._connection.ask({ op: "set", node, values });
  }

  async _defaults(node, remark) {
    const parameters = [...this._system.parameters.get(node)?.values() ?? []];
    const values = Object.fromEntries(parameters
      .filter((parameter) => parameter.value !== parameter.default)
      .map((parameter) => [parameter.name, parameter.default]));
    if (!Object.keys(values).length) return;
    this._remark(remark, await this._set(node, values));
  }

  async _save(node, remark) {
    const reply = await this._connection.ask({ op: "dump", node });
    this._remark(remark, reply);
    if (reply.ok) saveText(reply.toml, `${node}.toml`);
  }

  _remark(target, reply) {
    target.hidden = reply.ok;
    say(target, reply.ok ? "" : [reply.error, reply.allowed].filter(Boolean).join(". Allowed: "));
  }
}
