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
		this.clockOffset = null;
		connection.on("hello", (hello) => this.greet(hello));
		connection.on("streams", ({ streams }) => {
			this.streams = streams.map((stream) => ({ ...stream, since: milliseconds(stream.since_ns) }));
			this.emit("streams");
		});
		connection.on("nodes", ({ nodes }) => this.meet(nodes));
		connection.on("health", (report) => this.report(report));
		connection.on("parameters", ({ node, parameters }) => {
			this.parameters.set(node, new Map(parameters.map((one) => [one.name, one])));
			this.emit("parameters", { node });
		});
		connection.on("parameter", ({ node, parameter }) => {
			if (!this.parameters.has(node)) this.parameters.set(node, new Map());
			this.parameters.get(node).set(parameter.name, parameter);
			this.emit("parameter", { node, parameter });
		});
		connection.on("log", (line) => this.write(line));
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
		return performance.now() + (this.clockOffset ?? performance.timeOrigin);
	}

	stream(key) {
		return this.streams.find((stream) => stream.key === key);
	}

	get cameras() {
		return [...new Set(this.streams.map((stream) => stream.camera))].sort();
	}

	greet(hello) {
		if (this.hello && this.hello.version !== hello.version) location.reload();
		this.hello = hello;
		this.lines = []; // the server sends its last ones again
		this.setClock(hello.now_ns);
		this.emit("hello");
		this.emit("log");
	}

	setClock(now) {
		this.clockOffset = milliseconds(now) - performance.now();
	}

	meet(nodes) {
		this.nodes = [...nodes].sort((a, b) => (a.node < b.node ? -1 : 1));
		const known = new Set(nodes.map((node) => node.node));
		for (const kept of [this.health, this.histories, this.parameters]) {
			for (const name of [...kept.keys()]) if (!known.has(name)) kept.delete(name);
		}
		this.emit("nodes");
	}

	report({ node, diagnostics, at_ns: at }) {
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

	write(facts) {
		const line = { ...facts, at: milliseconds(facts.at_ns) };
		this.lines.push(line);
		if (this.lines.length > LINES_KEPT) this.lines.shift();
		this.emit("log", line);
	}
}

export function dropped(diagnostics) {
	return Object.entries(diagnostics.counters ?? {})
		.filter(([name]) => name.startsWith("dropped."))
		.reduce((sum, [, number]) => sum + number, 0);
}
