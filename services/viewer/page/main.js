// Puts the page together. The address's hash says what is shown: nothing for the wall, or the
// keys of streams, joined by "+", the first of which is large.

import { Connection } from "./connection.js";
import { byId, mark } from "./elements.js";
import { GraphPanel } from "./graph.js";
import { HealthPanel } from "./health.js";
import { listenToKeyboard } from "./keyboard.js";
import { Large } from "./large.js";
import { LogPanel } from "./log.js";
import { Panels } from "./panels.js";
import { ParametersPanel } from "./parameters.js";
import { PlotsPanel } from "./plots.js";
import { Status } from "./status.js";
import { System } from "./system.js";
import { applyTheme, nextTheme } from "./theme.js";
import { Wall } from "./wall.js";
import { Watches } from "./watching.js";

applyTheme();
const address = new URL("/live", location.href);
address.protocol = address.protocol.replace("http", "ws");
const connection = new Connection(address);
const system = new System(connection);
const watches = new Watches(connection);
const wall = new Wall(system, watches, connection);
const large = new Large(system, watches, connection, go);
const camera = () => large.camera;
const parameters = new ParametersPanel(system, connection, camera);
const plots = new PlotsPanel(system, watches, camera);
const graph = new GraphPanel(system, camera);
const panels = new Panels({
	parameters: {},
	plots,
	graph,
	health: new HealthPanel(system),
	log: new LogPanel(system),
});
new Status(system, connection);

function go(keys) {
	const hash = keys.join("+");
	if (hash === location.hash.slice(1)) return;
	if (hash) location.hash = hash;
	else {
		history.pushState(null, "", location.pathname + location.search);
		route();
	}
}

function route() {
	const keys = decodeURIComponent(location.hash.slice(1)).split("+").filter(Boolean);
	const before = document.body.dataset.view;
	const hadFocus = byId("wall").contains(document.activeElement);
	const shown = large.isOpen ? large.key : null;
	mark(document.body, "view", keys.length ? "large" : "wall");
	byId("wall").hidden = keys.length > 0;
	byId("large").hidden = !keys.length;
	wall.show(!keys.length);
	if (keys.length) large.open(keys);
	else large.close();
	document.title = keys.length ? `${keys[0]} – zenoh-vision` : "zenoh-vision";
	if (before === "large" && !keys.length) wall.focus(shown);
	if (hadFocus && keys.length) byId("pause").focus({ preventScroll: true });
	arrange();
}

function arrange() {
	parameters.arrange();
	plots.arrange();
	graph.arrange();
}

let seen = null;
system.on("streams", () => {
	if (large.camera !== seen) arrange();
	seen = large.camera;
});

byId("theme").addEventListener("click", nextTheme);
for (const button of document.querySelectorAll("[data-act]")) {
	const { act, by } = button.dataset;
	button.addEventListener("click", () => large[act](by === undefined ? by : Number(by)));
}
for (const link of document.querySelectorAll('a[href="#"]')) {
	link.addEventListener("click", (event) => {
		event.preventDefault();
		go([]);
	});
}
listenToKeyboard({ wall, large, panels, go, theme: nextTheme });
addEventListener("hashchange", route);
route();
