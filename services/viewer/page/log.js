// The panel of log lines: what changed in the system, newest last.

import { byId, element } from "./elements.js";
import { clock } from "./format.js";

const AT_END_PX = 24;

export class LogPanel {
  constructor(system) {
    this._system = system;
    this._visible = false;
    this._list = byId("log-lines");
    this._filter = byId("log-filter");
    this._filter.addEventListener("input", () => this._fill());
    system.on("log", (line) => (line ? this._append(line) : this._fill()));
  }

  show(visible) {
    this._visible = visible;
    if (visible) this._fill();
  }

  _fill() {
    if (!this._visible) return;
    const words = this._filter.value.toLowerCase();
    this._list.replaceChildren(...this._system.lines
      .filter((line) => textOf(line).toLowerCase().includes(words)).map(row));
    byId("no-lines").hidden = this._list.children.length > 0;
    this._list.scrollTop = this._list.scrollHeight;
  }

  /** Add one line; follow it only if the end was seen. */
  _append() {
    if (!this._visible) return;
    const line = this._system.lines.at(-1);
    if (!textOf(line).toLowerCase().includes(this._filter.value.toLowerCase())) return;
    const { scrollTop, scrollHeight, clientHeight } = this._list;
    const atEnd = scrollHeight - scrollTop - clientHeight < AT_END_PX;
    this._list.append(row(line));
    byId("no-lines").hidden = true;
    if (this._list.children.length > 1000) this._list.firstChild.remove();
    if (atEnd) this._list.scrollTop = this._list.scrollHeight;
  }
}

function textOf(line) {
  return `${line.level} ${line.node ?? ""} ${line.text}`;
}

function row(line) {
  return element("li", { "data-level": line.level }, element("time", {}, clock(line.at)),
    element("span", { class: "level" }, line.level),
    element("b", {}, line.node ?? ""), element("span", { class: "text" }, line.text));
}
