// Shows whether the page is connected to the server and the server to the router, and if not, why.

import { byId, setData, setText } from "./ui/elements.js";
import { bitRate, number } from "./ui/format.js";

const ERROR_MS = 8000;
const SLOW_MS = 8000; // the server reports a slow link every 2 s

/** Returns a function that shows a sentence about something that was refused, for some seconds. */
export function showConnection(system, connection, watches) {
	let failures = 0;
	let hasEnded = false; // the session
	let refusal = "";
	let refusalTimer;
	let slow = null; // what the link carries: {bits_per_s, at}

	/** Why fewer pictures are shown than there are; empty if the link is not the reason. */
	function slowness() {
		const now = performance.now();
		if (!slow || now - slow.at > SLOW_MS) return "";
		const { arriving, all } = watches.rates(now);
		const few = all > arriving ? `: ${number(arriving, arriving < 10 ? 1 : 0)} of `
			+ `${number(all, 0)} pictures a second fit` : "";
		return `The link carries ${bitRate(slow.bits_per_s)}${few}.`;
	}

	function draw() {
		const { routerConnected, hello } = system;
		const state = !connection.isOpen ? "down" : routerConnected === false ? "no-router" : "up";
		const [words, text] = {
			down: ["no connection to the viewer", hasEnded
				? "The session has ended. Open the address that the viewer printed."
				: "The viewer's server does not answer. This page reconnects automatically."],
			"no-router": ["no router", "The viewer has no router. It reconnects automatically."],
			up: [hello ? `${hello.namespace} · connected` : "connected", slowness()],
		}[state];
		setData(byId("link"), { state });
		setText(byId("link-words"), words);
		setText(byId("banner"), refusal || text);
		setData(byId("banner"), { kind: refusal || hasEnded ? "refused" : "" });
	}

	system.on("router hello", draw);
	connection.on("link", (link) => {
		slow = { ...link, at: performance.now() };
		draw();
	});
	connection.on("tick", () => slow && draw());
	connection.on("open", () => {
		failures = 0;
		hasEnded = false;
		draw();
	});
	connection.on("close", async () => {
		failures += 1;
		slow = null;
		draw();
		if (failures % 4 !== 2) return;
		// A WebSocket does not tell why it is refused, so try HTTP now and then.
		const { status } = await fetch("page/icon.svg", { cache: "no-store" }).catch(() => ({ status: 0 }));
		hasEnded = status === 401 && !connection.isOpen;
		draw();
	});

	function refuse(text) {
		refusal = text;
		draw();
		clearTimeout(refusalTimer);
		refusalTimer = setTimeout(() => {
			refusal = "";
			draw();
		}, ERROR_MS);
	}
	connection.on("error", ({ text }) => refuse(text));
	return refuse;
}
