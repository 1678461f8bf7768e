// The panel of health: one row a node, its counters behind it.

import { byId, element, inPlace, mark, say } from "./elements.js";
import { count, duration, number, rate } from "./format.js";
import { dropped } from "./system.js";

const LEVELS = ["OK", "WARN", "ERROR", "STALE"];
const STALE_MS = 3500;

export class HealthPanel {
	constructor(system) {
		this.system = system;
		this.visible = false;
		this.rows = new Map();
		system.on("nodes", () => this.draw());
		system.on("health", () => this.draw());
		setInterval(() => this.draw(), 1000);
	}

	show(visible) {
		this.visible = visible;
		this.draw();
	}

	draw() {
		this.summary();
		if (!this.visible) return;
		const names = new Set(this.system.nodes.map((node) => node.node));
		for (const [name, row] of this.rows) {
			if (names.has(name)) continue;
			row.element.remove();
			this.rows.delete(name);
		}
		const rows = this.system.nodes.map((node) => {
			if (!this.rows.has(node.node)) this.rows.set(node.node, this.newRow(node));
			this.fill(this.rows.get(node.node), node);
			return this.rows.get(node.node).element;
		});
		inPlace(byId("health"), rows);
		byId("no-nodes").hidden = names.size > 0;
	}

	/** How a node is: its level as a word, and what it says. */
	level(node) {
		const report = this.system.health.get(node.node);
		if (node.alive === false) return { level: "GONE", message: "its liveliness token is gone" };
		if (!report) return { level: "–", message: "no report yet" };
		const silence = this.system.now - report.at;
		if (silence > STALE_MS) return { level: "STALE", message: `no report for ${duration(silence)}` };
		const { level, message } = report.diagnostics;
		return { level: LEVELS[level] ?? String(level), message };
	}

	newRow(node) {
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

	fill({ element: row, cells }, node) {
		const { level, message } = this.level(node);
		const diagnostics = this.system.health.get(node.node)?.diagnostics;
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
	summary() {
		const bad = this.system.nodes
			.filter((node) => !["OK", "–"].includes(this.level(node).level)).length;
		say(byId("health-count"), bad ? String(bad) : "");
		byId("health-count").hidden = !bad;
	}
}
