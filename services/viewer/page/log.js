// The panel of log lines: what changed in the system, newest last.

import { byId, element } from "./elements.js";
import { clock } from "./format.js";

const AT_END_PX = 24;
const LINES_SHOWN = 1000;

export class LogPanel {
	constructor(system) {
		this.system = system;
		this.list = byId("log-lines");
		system.on("log", (line) => this.write(line ? [line] : null));
	}

	show(visible) {
		this.visible = visible;
		this.write(null);
	}

	/** Add lines, or write all anew; the list follows only if its end was seen. */
	write(added) {
		if (!this.visible) return;
		const { scrollTop, scrollHeight, clientHeight } = this.list;
		const atEnd = !added || scrollHeight - scrollTop - clientHeight < AT_END_PX;
		if (added) this.list.append(...added.map(row));
		else this.list.replaceChildren(...this.system.lines.map(row));
		while (this.list.children.length > LINES_SHOWN) this.list.firstChild.remove();
		byId("no-lines").hidden = this.list.children.length > 0;
		if (atEnd) this.list.scrollTop = this.list.scrollHeight;
	}
}

function row({ at, level, node, text }) {
	return element("li", { "data-level": level }, element("time", {}, clock(at)),
		element("span", { class: "level" }, level), node ? element("b", {}, node) : null, text);
}
