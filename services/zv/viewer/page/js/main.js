// Puts the page together. The fragment of the URL says what is shown: nothing for the wall, or the
// keys of streams, joined by "+", the first of which leads.
//
// Each folder imports only from folders listed below it, which a test checks:
//
//   main.js, keyboard.js, connection_status.js: the page as a whole
//   wall/        all streams at once, as tiles
//   inspector/   one stream large, with others beside it, overlay, zoom, pause
//   panels/      the dock's panels: parameters, plots, graph, health, log
//   export/      frames and texts as files
//   video/       which streams are watched; pictures and messages to frames, pause, overlay
//   model/       the state of the running system and of each stream
//   transport/   the WebSocket: its messages, reconnecting
//   ui/          elements, numbers as text, preferences

import { showConnection } from "./connection_status.js";
import { Inspector } from "./inspector/inspector.js";
import { listenToKeyboard } from "./keyboard.js";
import { System } from "./model/system.js";
import { Dock } from "./panels/dock.js";
import { GraphPanel } from "./panels/graph.js";
import { HealthPanel, LogPanel } from "./panels/health.js";
import { ParametersPanel } from "./panels/parameters.js";
import { PlotsPanel } from "./panels/plots.js";
import { Connection } from "./transport/connection.js";
import { byId, setData } from "./ui/elements.js";
import { startTheme } from "./ui/preferences.js";
import { Watches } from "./video/watches.js";
import { Wall } from "./wall/wall.js";

startTheme();
const address = new URL("/live?show=", location.href); // no panel is open yet
address.protocol = address.protocol.replace("http", "ws");
const connection = new Connection(address);
const system = new System(connection);
const watches = new Watches(connection);
const wall = new Wall(system, watches);
const inspector = new Inspector(system, watches, connection, go);
const camera = () => inspector.camera;
const panels = {
	parameters: new ParametersPanel(system, connection, camera),
	plots: new PlotsPanel(system, watches, camera),
	graph: new GraphPanel(system, camera),
	health: new HealthPanel(system),
	log: new LogPanel(system),
};
const dock = new Dock(panels, (kinds) => system.show(kinds));
showConnection(system, connection, watches);

/** Show the streams of these keys; the wall if there are none. */
function go(keys) {
	const hash = keys.join("+");
	if (hash === location.hash.slice(1)) return;
	history.pushState(null, "", hash ? `#${hash}` : location.pathname + location.search);
	route();
}

/** Show the streams in the URL; all streams if it cannot be decoded. */
function route() {
	let hash = "";
	try {
		hash = decodeURIComponent(location.hash.slice(1));
	} catch {
		history.replaceState(null, "", location.pathname + location.search);
	}
	const keys = [...new Set(hash.split("+"))].filter(Boolean);
	const isLarge = keys.length > 0;
	const before = inspector.key;
	const hadFocus = byId("wall").contains(document.activeElement);
	setData(document.body, { view: isLarge ? "large" : "wall" });
	byId("wall").hidden = isLarge;
	byId("large").hidden = !isLarge;
	wall.show(!isLarge);
	if (isLarge) inspector.open(keys);
	else inspector.close();
	document.title = isLarge ? `${keys[0]} – zenoh-vision` : "zenoh-vision";
	if (before && !isLarge) wall.focus(before);
	if (hadFocus && isLarge) byId("pause").focus({ preventScroll: true });
	for (const panel of [panels.parameters, panels.plots, panels.graph]) panel.draw();
}

for (const button of document.querySelectorAll("[data-act]")) {
	const { act, by } = button.dataset;
	button.addEventListener("click", () => inspector[act](by === undefined ? by : Number(by)));
}
for (const link of document.querySelectorAll('a[href="#"]')) {
	link.addEventListener("click", (event) => {
		event.preventDefault();
		go([]);
	});
}
listenToKeyboard({ wall, inspector, dock, go });
addEventListener("hashchange", route);
route();
