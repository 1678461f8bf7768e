// How the page stands with the server and the server with the router, and why if not well.

import { byId, mark, say } from "./elements.js";

const REFUSAL_MS = 8000;

export class Status {
	constructor(system, connection) {
		this.system = system;
		this.connection = connection;
		this.failures = 0;
		connection.on("open", () => {
			this.failures = 0;
			this.write();
		});
		connection.on("close", () => this.closed());
		connection.on("error", ({ text }) => {
			this.banner(text, "refused");
			setTimeout(() => this.write(), REFUSAL_MS);
		});
		system.on("router", () => this.write());
		system.on("hello", () => this.write());
	}

	write() {
		const { isOpen } = this.connection;
		const { routerConnected, hello } = this.system;
		const state = !isOpen ? "down" : routerConnected === false ? "no-router" : "up";
		mark(byId("link"), "state", state);
		say(byId("link-words"), {
			down: "no connection to the viewer",
			"no-router": "no router",
			up: hello ? `${hello.namespace} · connected` : "connected",
		}[state]);
		if (state === "up") this.banner("");
		if (state === "no-router") {
			this.banner("The viewer has no router. It connects again by itself.");
		}
	}

	closed() {
		this.failures += 1;
		this.write();
		this.banner("The viewer's server does not answer. This page connects again by itself.");
		if (this.failures % 4 === 2) this.askWhy();
	}

	/** A WebSocket does not tell why it was refused; an ordinary request does. */
	async askWhy() {
		const { status } = await fetch("/page/icon.svg", { cache: "no-store" }).catch(() => ({}));
		if (status === 401 && !this.connection.isOpen) {
			this.banner("The token is not valid any more. Open the address that the viewer printed.",
				"refused");
		}
	}

	banner(text, kind = "") {
		const banner = byId("banner");
		say(banner, text);
		banner.hidden = !text;
		mark(banner, "kind", kind);
	}
}
