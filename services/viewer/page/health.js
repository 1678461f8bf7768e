// The panel of health: one row a node, its counters behind it.

import { byId, element, mark, say } from "./elements.js";
import { count, duration, number, rate } from "./format.js";
import { dropped } from "./system.js";

const LEVELS = ["OK", "WARN", "ERROR", "STALE"];
const STALE_MS = 3500;

export class HealthPanel {
  constructor(system) {
    this._system = system;
    this._visible = false;
    this._rows = new Map();
    system.on("nodes", () => this._draw());
    system.on("health", () => this._draw());
    setInterval(() => this._draw(), 1000);
  }

  show(visible) {
    this._visible = visible;
    this._draw();
  }

  _draw() {
    this._summary();
    if (!this._visible) return;
    const names = new Set(this._system.nodes.map((node) => node.node));
    for (const [name, row] of this._rows) {
      if (names.has(name)) continue;
      row.element.remove();
      this._rows.delete(name);
    }
    this._system.nodes.forEach((node, index) => {
      if (!this._rows.has(node.node)) this._rows.set(node.node, this._newRow(node));
      const row = this._rows.get(node.node);
      if (byId("health").children[index] !== row.element) {
        byId("health").insertBefore(row.element, byId("health").children[index] ?? null);
      }
      this._fill(row, node);
    });
    byId("no-nodes").hidden = names.size > 0;
  }

  /** How a node is: its level as a word, and what it says. */
  _level(node) {
    const report = this._system.health.get(node.node);
    if (node.alive === false) return { level: "GONE", message: "its liveliness token is gone" };
    if (!report) return { level: "–", message: "no report yet" };
    const silence = this._system.now - report.at;
    if (silence > STALE_MS) return { level: "STALE", message: `no report for ${duration(silence)}` };
    const { level, message } = report.diagnostics;
    return { level: LEVELS[level] ?? String(level), message };
  }

  _newRow(node) {
    const cells = {};
    for (const name of ["level", "rate", "p50", "p99", "drops"]) {
      cells[name] = element("span", { class: `cell-${name}` });
    }
    cells.message = element("p", { class: "message" });
    cells.counters = element("dl", { class: "counters" });
    cells.about = element("p", { class: "about" });
    const { level, rate: hz, p50, p99, drops, message, counters, about } = cells;
    const made = element("details", { "data-node": node.node }, element("summary", {},
      element("i", { class: "lamp" }), element("b", {}, node.node), level, hz, p50, p99, drops),
    message, about, counters);
    return { element: made, cells };
  }

  _fill({ element: row, cells }, node) {
    const { level, message } = this._level(node);
    const diagnostics = this._system.health.get(node.node)?.diagnostics;
    const ms = (value) => (value === null || value === undefined ? "–" : number(value, 1));
    mark(row, "level", level);
    say(cells.level, level);
    say(cells.rate, diagnostics ? rate(diagnostics.rate_hz) : "–");
    say(cells.p50, ms(diagnostics?.latency_ms?.p50));
    say(cells.p99, ms(diagnostics?.latency_ms?.p99));
    say(cells.drops, diagnostics ? count(dropped(diagnostics)) : "–");
    say(cells.message, message || "well");
    say(cells.about, `${node.service} ${node.version} on ${node.host}, process ${node.pid}${
      diagnostics ? `, up ${duration(1000 * diagnostics.uptime_s)}` : ""}`);
    if (!row.open) return;
    cells.counters.replaceChildren(...Object.entries(diagnostics?.counters ?? {}).flatMap(
      ([name, value]) => [element("dt", {}, name), element("dd", {}, count(value))]));
  }

  /** The count beside the panel's name, so that trouble is seen with the panel closed. */
  _summary() {
    const bad = this._system.nodes
      .filter((node) => !["OK", "–"].includes(this._level(node).level)).length;
    say(byId("health-count"), bad ? String(bad) : "");
    byId("health-count").hidden = !bad;
  }
}
