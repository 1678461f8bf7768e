// Shows whether the page is connected to the server and the server to the router, and if not, why.

import { byId, setData, setText } from "./ui/elements.js";

const ERROR_MS = 8000;

export function showConnection(system, connection) {
	let failures = 0;

	function draw() {
		const { routerConnected, hello } = system;
		const state = !connection.isOpen ? "down" : routerConnected === false ? "no-router" : "up";
		const [words, text] = {
			down: ["no connection to the viewer",
				"The viewer's server does not answer. This page reconnects automatically."],
			"no-router": ["no router", "The viewer has no router. It reconnects automatically."],
			up: [hello ? `${hello.namespace} · connected` : "connected", ""],
		}[state];
		setData(byId("link"), { state });
		setText(byId("link-words"), words);
		banner(text);
	}

	system.on("router hello", draw);
	connection.on("open", () => {
		failures = 0;
		draw();
	});
	connection.on("close", async () => {
		failures += 1;
		draw();
		if (failures % 4 !== 2) return;
		// A WebSocket does not tell why the server refuses it, so ask by HTTP now and then.
		const { status } = await fetch("/page/icon.svg", { cache: "no-store" }).catch(() => ({}));
		if (status === 401 && !connection.isOpen) {
			banner("The session has ended. Open the address that the viewer printed.", "refused");
		}
	});
	connection.on("error", ({ text }) => {
		banner(text, "refused");
		setTimeout(draw, ERROR_MS);
	});
}

function banner(text, kind = "") {
	setText(byId("banner"), text);
	setData(byId("banner"), { kind });
	byId("banner").hidden = !text;
}
