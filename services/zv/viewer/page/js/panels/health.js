// The panels of health, one row for each node with its counters below, and of the log.

import { byId, drawList, element, later, setData, setText } from "../ui/elements.js";
import { clock, count, duration, number, rate } from "../ui/format.js";
import { lineList } from "./dock.js";

const LEVELS = ["OK", "WARN", "ERROR", "STALE"];
const STALE_MS = 3500;
const CELLS = ["level", "rate", "p50", "p99", "lost"];
const SETTLE_MS = 100; // one drawing for the reports of many nodes

/** The panel of health; what draws it also counts the nodes that are not well. */
export function healthPanel(system) {
	const panel = { visible: false, draw }; // set by the dock

	function draw() {
		if (document.hidden) return;
		const { nodes } = system;
		const bad = nodes.filter((node) => !["OK", "–"].includes(stateOf(node).level)).length;
		setText(byId("health-count"), bad ? String(bad) : ""); // also visible with the panel closed
		if (!panel.visible) return;
		const rows = drawList(byId("health"), nodes.map((node) => node.node), makeHealthRow);
		for (const node of nodes) fill(rows.get(node.node), node);
	}

	/** A node's level as a word, and its status text. */
	function stateOf(node) {
		const report = system.report(node.node);
		if (node.alive === false) return { level: "GONE", message: "its liveliness token is gone" };
		if (!report) return { level: "–", message: "no report yet" };
		const silence = performance.now() - report.at;
		if (silence > STALE_MS) return { level: "STALE", message: `no report for ${duration(silence)}` };
		const { level, message } = report.diagnostics;
		return { level: LEVELS[level] ?? String(level), message };
	}

	function fill(row, node) {
		const { level, message } = stateOf(node);
		const { diagnostics, rate: hz, p50, p99, lost } = system.report(node.node) ?? {};
		const taken = Object.entries(diagnostics?.routes ?? {}).map(([key, way]) => `${key} by ${way}`);
		const way = taken.length ? `, takes ${taken.join(", ")}` : "";
		const lag = diagnostics?.source_lag_ms;
		const behind = lag == null ? "" : `, its source is ${number(lag, 0)} ms behind the capture`;
		const uptime = diagnostics ? `, up ${duration(1000 * diagnostics.uptime_s)}` : "";
		const texts = {
			level,
			rate: rate(hz),
			p50: number(p50, 1),
			p99: number(p99, 1),
			lost: diagnostics ? count(lost) : "–",
			message: message || "well",
			about: `${node.service} ${node.version} on ${node.host}, process ${node.pid}${uptime}${way}${behind}`,
		};
		for (const [name, text] of Object.entries(texts)) setText(row[name], text);
		setData(row.element, { level });
		if (!row.element.open) return;
		row.counters.replaceChildren(...Object.entries(diagnostics?.counters ?? {}).flatMap(
			([name, value]) => [element("dt", {}, name), element("dd", {}, count(value))]));
	}

	system.on("nodes health", later(draw, SETTLE_MS));
	setInterval(draw, 1000);
	return panel;
}

/** A node's row: {element, message, about, counters, and the cells}. */
function makeHealthRow(node) {
	const values = CELLS.map((name) => [name, element("span")]);
	const cells = values.map(([name, value]) => element("span", { class: `cell-${name}` },
		element("span", { class: "only-read" }, `${name} `), value));
	const row = { ...Object.fromEntries(values), message: element("p", { class: "message" }),
		about: element("p", { class: "about" }), counters: element("dl", { class: "counters" }) };
	row.element = element("details", { "data-node": node }, element("summary", {},
		element("i", { class: "lamp" }), element("b", {}, node), ...cells),
	row.message, row.about, row.counters);
	return row;
}

/** The panel of the log of changes of the system, newest last. */
export function logPanel(system) {
	const list = lineList("log-lines", () => system.lines, makeLogRow);
	system.on("log", list.drawSoon);
	return list;
}

function makeLogRow({ at, level, node, text }) {
	return element("li", { "data-level": level }, element("time", {}, clock(at)),
		element("span", { class: "level" }, level), node ? element("b", {}, node) : null, text);
}
