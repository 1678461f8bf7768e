// How the page stands with the server and the server with the router, and why if not well.

import { byId, mark, say } from "./elements.js";

export class Status {
  constructor(system, connection) {
    this._system = system;
    this._connection = connection;
    this._failures = 0;
    connection.on("open", () => {
      this._failures = 0;
      this._write();
    });
    connection.on("close", (event) => this._closed(event));
    connection.on("error", ({ text }) => this._banner(text, "refused"));
    system.on("router", () => this._write());
    system.on("hello", () => this._write());
  }

  _write() {
    const { isOpen } = this._connection;
    const { routerConnected, hello } = this._system;
    const state = !isOpen ? "down" : routerConnected === false ? "no-router" : "up";
    mark(byId("link"), "state", state);
    say(byId("link-words"), {
      down: "no connection to the viewer",
      "no-router": "no router",
      up: hello ? `${hello.namespace} · connected` : "connected",
    }[state]);
    if (state === "up") this._banner("");
    if (state === "no-router") {
      this._banner("The viewer has no router. It connects again by itself.", "down");
    }
  }

  async _closed({ was }) {
    this._failures += 1;
    this._write();
    this._banner("The viewer's server does not answer. This page connects again by itself.", "down");
    if (!was && this._failures % 4 === 1) await this._askWhy();
  }

  /** A WebSocket does not tell why it was refused; an ordinary request does. */
  async _askWhy() {
    try {
      const { status } = await fetch("/page/icon.svg", { cache: "no-store" });
      if (this._connection.isOpen) return;
      if (status === 401) {
        this._banner("The token is not valid any more. Open the address that the viewer printed "
          + "when it started.", "refused");
      }
    } catch {
      // The server is not there: that is said already.
    }
  }

  _banner(text, kind = "") {
    const banner = byId("banner");
    say(banner, text);
    banner.hidden = !text;
    mark(banner, "kind", kind);
  }
}
