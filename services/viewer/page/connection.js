// The WebSocket to the server: opened again for ever, silent ones given up, texts held to the
// server's limits. Emits "open", "close", "picture" and each text by its `op`.

import { Events } from "./events.js";
import { readPicture } from "./wire.js";

const FIRST_DELAY_MS = 250;
const LONGEST_DELAY_MS = 2000;
const SILENCE_MS = 6000;
const BURST = 20;
const TEXTS_PER_SECOND = 25; // the server allows 50 in any second
const REPLY_MS = 5000;

export class Connection extends Events {
	constructor(address) {
		super();
		this.isOpen = false;
		this.address = address;
		this.delay = FIRST_DELAY_MS;
		this.queue = [];
		this.credit = BURST;
		this.replies = new Map();
		this.nextId = 1;
		this.on("reply", (reply) => this.settle(reply.id, reply));
		setInterval(() => this.refill(), 1000 / TEXTS_PER_SECOND);
		setInterval(() => this.giveUpIfSilent(), 1000);
		document.addEventListener("visibilitychange", () => document.hidden || this.tryNow());
		this.open();
	}

	/** Send one operation when the limit allows it; dropped while there is no connection. */
	send(operation) {
		if (!this.isOpen) return;
		this.queue.push(operation);
		this.flush();
	}

	/** Tell the server that a picture was taken. Not limited: each answers one of its own. */
	shown(key) {
		if (this.isOpen) this.socket.send(JSON.stringify({ op: "shown", key }));
	}

	/** Send an operation and return its reply: {ok, error?, allowed?, ...}; never rejects. */
	ask(operation) {
		const id = this.nextId;
		this.nextId += 1;
		return new Promise((resolve) => {
			const timer = setTimeout(
				() => this.settle(id, { ok: false, error: "no reply from the viewer's server" }),
				REPLY_MS,
			);
			this.replies.set(id, { resolve, timer });
			if (this.isOpen) this.send({ ...operation, id });
			else this.settle(id, { ok: false, error: "not connected to the viewer's server" });
		});
	}

	open() {
		clearTimeout(this.timer);
		this.timer = null;
		const socket = new WebSocket(this.address);
		socket.binaryType = "arraybuffer";
		this.socket = socket;
		this.heardAt = performance.now();
		socket.onopen = () => {
			this.isOpen = true;
			this.credit = BURST;
			this.emit("open");
		};
		socket.onmessage = (event) => this.receive(event.data);
		socket.onclose = () => this.closed(socket);
	}

	receive(data) {
		this.heardAt = performance.now();
		this.delay = FIRST_DELAY_MS;
		if (typeof data === "string") {
			const { op, ...facts } = JSON.parse(data);
			this.emit(op, facts);
		} else {
			this.emit("picture", { ...readPicture(data), at: this.heardAt });
		}
	}

	closed(socket) {
		if (socket !== this.socket || this.timer) return;
		this.isOpen = false;
		this.queue = [];
		for (const id of [...this.replies.keys()]) {
			this.settle(id, { ok: false, error: "the connection to the viewer's server was lost" });
		}
		this.emit("close");
		this.timer = setTimeout(() => this.open(), this.delay * (0.75 + Math.random() / 2));
		this.delay = Math.min(2 * this.delay, LONGEST_DELAY_MS);
	}

	tryNow() {
		if (!this.isOpen && this.timer) this.open();
	}

	/** A connection whose other end vanished stays "open" for minutes; not even ticks come on it. */
	giveUpIfSilent() {
		if (this.timer || performance.now() - this.heardAt < SILENCE_MS) return;
		const socket = this.socket;
		socket.close();
		this.closed(socket);
	}

	refill() {
		this.credit = Math.min(BURST, this.credit + 1);
		this.flush();
	}

	flush() {
		while (this.isOpen && this.queue.length && this.credit >= 1) {
			this.credit -= 1;
			this.socket.send(JSON.stringify(this.queue.shift()));
		}
	}

	settle(id, reply) {
		const waiting = this.replies.get(id);
		if (!waiting) return;
		clearTimeout(waiting.timer);
		this.replies.delete(id);
		waiting.resolve(reply);
	}
}
