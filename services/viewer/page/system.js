// What is known of the running system: streams, nodes, their health, parameters, log lines.
// Emits "streams", "nodes", "health", "parameters", "log", "router" when any of it changes.

import { Events } from "./events.js";
import { milliseconds } from "./wire.js";

const LINES_KEPT = 1000;
const HISTORY_MS = 5 * 60 * 1000;

export class System extends Events {
  constructor(connection) {
    super();
    this.hello = null;
    this.streams = [];
    this.nodes = [];
    this.health = new Map();
    this.histories = new Map();
    this.parameters = new Map();
    this.lines = [];
    this.routerConnected = null;
    this._clockOffset = null;
    connection.on("hello", (hello) => this._greet(hello));
    connection.on("tick", (tick) => this._setClock(tick.now_ns));
    connection.on("streams", ({ streams }) => {
      this.streams = streams.map((stream) => ({ ...stream, since: milliseconds(stream.since_ns) }));
      this.emit("streams");
    });
    connection.on("nodes", ({ nodes }) => this._meet(nodes));
    connection.on("health", (report) => this._report(report));
    connection.on("parameters", ({ node, parameters }) => {
      this.parameters.set(node, new Map(parameters.map((one) => [one.name, one])));
      this.emit("parameters", { node });
    });
    connection.on("parameter", ({ node, parameter }) => {
      if (!this.parameters.has(node)) this.parameters.set(node, new Map());
      this.parameters.get(node).set(parameter.name, parameter);
      this.emit("parameter", { node, parameter });
    });
    connection.on("log", (line) => this._write(line));
    connection.on("router", ({ connected }) => {
      this.routerConnected = connected;
      this.emit("router");
    });
    connection.on("close", () => {
      this.routerConnected = null;
      this.emit("router");
    });
  }

  /** Milliseconds since 1970 by the server's clock, which the streams' times are told in. */
  get now() {
    return performance.now() + (this._clockOffset ?? performance.timeOrigin);
  }

  /** The stream of a key, or undefined. */
  stream(key) {
    return this.streams.find((stream) => stream.key === key);
  }

  /** All cameras' names, in order. */
  get cameras() {
    return [...new Set(this.streams.map((stream) => stream.camera))].sort();
  }

  _greet(hello) {
    if (this.hello && this.hello.version !== hello.version) location.reload();
    this.hello = hello;
    this.lines = []; // the server sends its last ones again
    this._setClock(hello.now_ns);
    this.emit("hello");
    this.emit("log");
  }

  _setClock(nowNs) {
    const offset = milliseconds(nowNs) - performance.now();
    // What comes late makes the server's clock look slow, never fast; but clocks are set, too.
    const isSet = this._clockOffset === null || Math.abs(offset - this._clockOffset) > 2000;
    this._clockOffset = isSet ? offset : Math.max(offset, this._clockOffset);
  }

  _meet(nodes) {
    this.nodes = [...nodes].sort((a, b) => (a.node < b.node ? -1 : 1));
    const known = new Set(nodes.map((node) => node.node));
    for (const kept of [this.health, this.histories, this.parameters]) {
      for (const name of [...kept.keys()]) if (!known.has(name)) kept.delete(name);
    }
    this.emit("nodes");
  }

  _report({ node, diagnostics, at_ns: at }) {
    const now = milliseconds(at) ?? this.now;
    const history = this.histories.get(node) ?? [];
    const before = this.health.get(node)?.diagnostics;
    const drops = dropped(diagnostics) - (before ? dropped(before) : dropped(diagnostics));
    history.push({
      at: now,
      rate: diagnostics.rate_hz,
      p50: diagnostics.latency_ms?.p50 ?? null,
      p99: diagnostics.latency_ms?.p99 ?? null,
      drops: Math.max(0, drops), // a node that was started again counts from 0
    });
    while (history.length && now - history[0].at > HISTORY_MS) history.shift();
    this.histories.set(node, history);
    this.health.set(node, { diagnostics, at: now });
    this.emit("health", { node });
  }

  _write(line) {
    this.lines.push({ ...line, at: milliseconds(line.at_ns) });
    if (this.lines.length > LINES_KEPT) this.lines.splice(0, this.lines.length - LINES_KEPT);
    this.emit("log", line);
  }
}

/** All drops of a health report together. */
export function dropped(diagnostics) {
  return Object.entries(diagnostics.counters ?? {})
    .filter(([name]) => name.startsWith("dropped."))
    .reduce((sum, [, number]) => sum + number, 0);
}
