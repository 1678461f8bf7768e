// The state of the running system: streams, nodes, their health, parameters, log lines.
// Emits "hello", "streams", "matches", "nodes", "health", "parameters", "log", "router" when they
// change.

import { Events, milliseconds } from "../transport/connection.js";

const LINES_KEPT = 1000;
export const HISTORY_MS = 30 * 60 * 1000;
const LATE_MS = 500; // a message that says the time may be this late, on a slow link
const GAP_MS = 3000; // reports come once a second, but not while the page is hidden

export class System extends Events {
	constructor(connection) {
		super();
		this.connection = connection;
		this.shown = new Map(); // part of the page -> the kinds that it shows
		this.hello = null;
		this.streams = [];
		this.misnamed = []; // cameras of other programs that cannot be shown, by their names
		this.nodes = [];
		this.matches = new Map(); // key expression with wildcards -> the keys of streams that it matches
		// node -> [{at, diagnostics, lost, rate, p50, p99, drops|null}], `at` by the page's own clock,
		// which makes no steps; only the newest has its diagnostics.
		this.histories = new Map();
		this.parameters = new Map(); // node -> (name -> parameter)
		this.lines = [];
		this.routerConnected = null;
		this.clockOffset = performance.timeOrigin;
		connection.on("open", () => this.sendShown());
		connection.on("hello", (hello) => this.onHello(hello));
		connection.on("tick", ({ now_ns: now }) => this.setClock(milliseconds(now)));
		connection.on("streams", ({ streams }) => this.change("streams", {
			streams: streams.map((stream) => ({ ...stream, since: milliseconds(stream.since_ns) })) }));
		connection.on("misnamed", ({ cameras }) => this.change("streams", { misnamed: cameras }));
		connection.on("matches", ({ expressions }) =>
			this.change("matches", { matches: new Map(Object.entries(expressions)) }));
		connection.on("nodes", ({ nodes }) => this.onNodes(nodes));
		connection.on("health", (report) => this.onHealth(report));
		connection.on("parameters", ({ node, parameters }) => {
			this.parameters.set(node, new Map(parameters.map((one) => [one.name, one])));
			this.emit("parameters");
		});
		connection.on("parameter", ({ node, parameter }) => {
			if (!this.parameters.has(node)) this.parameters.set(node, new Map());
			this.parameters.get(node).set(parameter.name, parameter);
			this.emit("parameters");
		});
		connection.on("log", (line) => this.onLog(line));
		connection.on("router", ({ connected }) => this.change("router", { routerConnected: connected }));
		connection.on("close", () => this.change("router", { routerConnected: null }));
	}

	/** Set some of its fields, and tell of it by this event. */
	change(event, fields) {
		Object.assign(this, fields);
		this.emit(event);
	}

	/** Note which of "health", "parameters", "log" and "matches" a part of the page shows now. */
	show(kinds, part = "dock") {
		if (this.shown.get(part)?.join() === kinds.join()) return;
		this.shown.set(part, kinds);
		this.sendShown();
	}

	/** Tell the server what the page shows now. */
	sendShown() {
		this.connection.send({ op: "show", kinds: [...new Set([...this.shown.values()].flat())] });
	}

	/** Follow the server's clock, also in a step; a message that was late on its way is none. */
	setClock(serverNow) {
		const offset = serverNow - performance.now();
		const behind = this.clockOffset - offset;
		if (behind < 0 || behind > LATE_MS) this.clockOffset = offset;
	}

	/** Milliseconds since 1970 by the server's clock, which all times of streams refer to. */
	get now() {
		return performance.now() + this.clockOffset;
	}

	/** Whether the way to the nodes is cut: between page and viewer, or viewer and router. */
	get isLinkLost() {
		return this.routerConnected === false || (this.hello !== null && !this.connection.isOpen);
	}

	get cameras() {
		return [...new Set(this.streams.map((stream) => stream.camera))].sort();
	}

	stream(key) {
		return this.streams.find((stream) => stream.key === key);
	}

	node(name) {
		return this.nodes.find((node) => node.node === name);
	}

	onHello(hello) {
		if (this.hello && this.hello.version !== hello.version) location.reload();
		this.hello = hello;
		this.lines = []; // the server sends its last ones again
		this.clockOffset = milliseconds(hello.now_ns) - performance.now();
		this.emit("hello");
		this.emit("log");
	}

	onNodes(nodes) {
		this.nodes = [...nodes].sort((a, b) => (a.node < b.node ? -1 : 1));
		for (const kept of [this.histories, this.parameters]) {
			for (const name of kept.keys()) if (!this.node(name)) kept.delete(name);
		}
		this.emit("nodes");
	}

	onHealth({ node, diagnostics, lost: total, at_ns: at }) {
		const now = Math.min(performance.now(), milliseconds(at) - this.clockOffset);
		const history = this.histories.get(node) ?? [];
		const lost = Number(total); // a text if it is very large
		const before = history.at(-1) ?? { at: now, lost };
		before.diagnostics = null;
		const { rate_hz: rate, latency_ms: latency } = diagnostics;
		// The counters of a restarted node begin at 0.
		const more = Math.max(0, lost - before.lost);
		const drops = now - before.at > GAP_MS ? null : more; // after a gap: not per second
		history.push({ at: now, diagnostics, lost, rate, p50: latency?.p50, p99: latency?.p99, drops });
		while (now - history[0].at > HISTORY_MS) history.shift();
		this.histories.set(node, history);
		this.emit("health");
	}

	/** The newest report of a node's health, or undefined. */
	report(node) {
		return this.histories.get(node)?.at(-1);
	}

	onLog(fields) {
		const key = `${fields.at_ns} ${fields.text}`;
		// When the panel is opened again, the server sends its last lines again.
		if (this.lines.some((line) => line.key === key)) return;
		this.lines.push({ ...fields, key, at: milliseconds(fields.at_ns) });
		if (this.lines.length > LINES_KEPT) this.lines.shift();
		this.emit("log");
	}
}
