// Puts the page together. The fragment of the URL says what is shown, see model/layout.js.
//
// Each folder imports only from folders listed below it, which a test checks:
//
//   main.js, keyboard.js, connection_status.js, layout_menu.js: the page as a whole
//   wall/        all streams at once, as tiles
//   inspector/   one stream large, with others beside it, overlay, zoom, pause, range and colours
//   panels/      the dock's panels: parameters, plots, graph, events, health, log
//   export/      frames and texts as files, addresses
//   video/       which streams are watched; pictures and messages to frames, pause, overlay, colours
//   model/       the state of the running system and of each stream, the layout of the page
//   transport/   the WebSocket: its messages, reconnecting
//   ui/          elements, numbers as text, preferences

import { showConnection } from "./connection_status.js";
import { Inspector } from "./inspector/inspector.js";
import { listenToKeyboard } from "./keyboard.js";
import { layoutMenu } from "./layout_menu.js";
import { PLAIN, readLayout, writeLayout } from "./model/layout.js";
import { Orientations } from "./model/orientation.js";
import { System } from "./model/system.js";
import { Transfer } from "./model/transfer.js";
import { Dock } from "./panels/dock.js";
import { eventsPanel } from "./panels/events.js";
import { graphPanel } from "./panels/graph.js";
import { healthPanel, logPanel } from "./panels/health.js";
import { messagePanel } from "./panels/message.js";
import { parametersPanel } from "./panels/parameters.js";
import { plotsPanel } from "./panels/plots.js";
import { showReplay } from "./panels/replay_bar.js";
import { Connection } from "./transport/connection.js";
import { byId, setData } from "./ui/elements.js";
import { placeMenus } from "./ui/menus.js";
import { startTheme } from "./ui/preferences.js";
import { Watches } from "./video/watches.js";
import { Wall } from "./wall/wall.js";

startTheme();
placeMenus();
const address = new URL("live?show=", location.href); // no panel is open yet
address.protocol = address.protocol.replace("http", "ws");
const connection = new Connection(address);
const system = new System(connection);
const watches = new Watches(connection);
let layout = PLAIN;
const shared = { orientations: new Orientations(), transfer: new Transfer(), setTransfer };
const wall = new Wall(system, watches, shared, (key) => writeLayout({ ...layout, keys: [key] }));
const inspector = new Inspector(system, watches, connection, go, shared);
const showInMenu = layoutMenu(system, shared.transfer, change);
const camera = () => inspector.camera;
const panels = {
	parameters: parametersPanel(system, connection, camera),
	plots: plotsPanel(system, watches, camera),
	graph: graphPanel(system, camera),
	message: messagePanel(system, connection, watches, camera, (key, name) => {
		dock.show("plots");
		panels.plots.plot(key, name);
	}),
	events: eventsPanel(system, watches),
	health: healthPanel(system),
	log: logPanel(system),
};
showReplay(system, watches, connection);
const dock = new Dock(panels, (kinds) => system.show(kinds));
const refuse = showConnection(system, connection, watches);

/** Show the streams of these keys, the wall if there are none, in the same layout but for a part. */
function go(keys, part = {}) {
	visit(writeLayout({ ...layout, ...part, keys }), "pushState");
}

/** Change some fields of the layout, in the same place of the browser's history. */
function change(part) {
	if ("width" in part || "quality" in part) setTransfer({ ...shared.transfer.common, ...part });
	else visit(writeLayout({ ...layout, ...part }), "replaceState");
}

/** Set the size and quality of all streams, in the URL if it has one, else in the browser. */
function setTransfer(choice) {
	if (shared.transfer.fixed) visit(writeLayout({ ...layout, ...choice }), "replaceState");
	else {
		shared.transfer.setCommon(choice);
		show();
	}
}

function visit(fragment, how) {
	if (fragment === location.hash.slice(1)) return;
	history[how](null, "", fragment ? `#${fragment}` : location.pathname + location.search);
	route();
}

/** Read the layout in the URL; if it cannot be decoded, the wall with all streams is shown. */
function route() {
	let fragment = "";
	try {
		fragment = decodeURIComponent(location.hash.slice(1));
	} catch {
		history.replaceState(null, "", location.pathname + location.search);
	}
	const { panel } = layout;
	const read = readLayout(fragment);
	({ layout } = read);
	if (read.refused.length) refuse(`In the address, ${read.refused.join("; ")}`);
	shared.transfer.fix(layout);
	if (layout.panel && layout.panel !== panel) {
		dock.show(layout.panel === "none" ? "" : layout.panel, { isKept: false });
	}
	show();
}

/** Show the streams of the layout. */
function show() {
	const { keys } = layout;
	const isLarge = keys.length > 0;
	const before = inspector.keys[0];
	const hadFocus = byId("wall").contains(document.activeElement);
	setData(document.body, { view: isLarge ? "large" : "wall", hide: layout.hide.join(" ") });
	showInMenu(layout);
	byId("wall").hidden = isLarge;
	byId("large").hidden = !isLarge;
	wall.show(!isLarge, layout);
	if (isLarge) inspector.open(keys);
	else inspector.close();
	document.title = isLarge ? `${keys[0]} – zenoh-vision` : "zenoh-vision";
	if (before && !isLarge) wall.focus(before);
	if (hadFocus && isLarge) byId("pause").focus({ preventScroll: true });
	for (const panel of [panels.parameters, panels.plots, panels.graph]) panel.draw();
}

/** Show the hidden parts of the page again; returns whether there were any. */
function unhide() {
	const isHidden = layout.hide.length > 0;
	if (isHidden) change({ hide: [] });
	return isHidden;
}

for (const button of document.querySelectorAll("[data-act]")) {
	const { act, by } = button.dataset; // the argument, a number or a word
	button.addEventListener("click", () => inspector.commands[act](Number(by) || by));
}
for (const link of document.querySelectorAll('a[href="#"]')) {
	link.addEventListener("click", (event) => {
		event.preventDefault();
		go([]);
	});
}
listenToKeyboard({ wall, inspector, dock, go, unhide });
addEventListener("hashchange", route);
route();
