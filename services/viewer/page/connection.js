// The WebSocket to the server: opened again for ever, silent ones given up, texts held to the
// server's limits. Emits "open", "close", "picture" and each text by its `op`.

import { Events } from "./events.js";
import { readPicture } from "./wire.js";

const FIRST_DELAY_MS = 250;
const LONGEST_DELAY_MS = 2000;
const SILENCE_MS = 6000; // the server says something every 2 s
const BURST = 20;
const TEXTS_PER_SECOND = 25; // the server allows 50 in any second
const REPLY_MS = 5000;

export class Connection extends Events {
  constructor(address) {
    super();
    this.isOpen = false;
    this._address = address;
    this._delay = FIRST_DELAY_MS;
    this._queue = [];
    this._credit = BURST;
    this._replies = new Map();
    this._nextId = 1;
    this._ticks = false;
    this.on("tick", () => {
      this._ticks = true;
    });
    this.on("reply", (reply) => this._settle(reply.id, reply));
    setInterval(() => this._refill(), 1000 / TEXTS_PER_SECOND);
    setInterval(() => this._giveUpIfSilent(), 1000);
    addEventListener("online", () => this._tryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this._tryNow());
    this._open();
  }

  /** Send one operation when the limit allows it; dropped while there is no connection. */
  send(operation) {
    if (!this.isOpen) return;
    this._queue.push(operation);
    this._flush();
  }

  /** Tell the server that a picture was taken. Not limited: each answers one of its own. */
  shown(key) {
    if (this.isOpen) this._socket.send(JSON.stringify({ op: "shown", key }));
  }

  /** Send an operation and return its reply: {ok, error?, allowed?, ...}; never rejects. */
  ask(operation) {
    const id = this._nextId;
    this._nextId += 1;
    return new Promise((resolve) => {
      const timer = setTimeout(
        () => this._settle(id, { ok: false, error: "no reply from the viewer's server" }),
        REPLY_MS,
      );
      this._replies.set(id, { resolve, timer });
      if (this.isOpen) this.send({ ...operation, id });
      else this._settle(id, { ok: false, error: "not connected to the viewer's server" });
    });
  }

  _open() {
    clearTimeout(this._timer);
    this._timer = null;
    const socket = new WebSocket(this._address);
    socket.binaryType = "arraybuffer";
    this._socket = socket;
    this._ticks = false;
    this._heardAt = performance.now();
    socket.onopen = () => {
      this.isOpen = true;
      this._credit = BURST;
      this.emit("open");
    };
    socket.onmessage = (event) => this._receive(event.data);
    socket.onclose = (event) => this._closed(socket, event);
  }

  _receive(data) {
    this._heardAt = performance.now();
    this._delay = FIRST_DELAY_MS;
    if (typeof data === "string") {
      const { op, ...facts } = JSON.parse(data);
      this.emit(op, facts);
    } else {
      this.emit("picture", { ...readPicture(data), at: this._heardAt });
    }
  }

  _closed(socket, event) {
    if (socket !== this._socket || this._timer) return;
    const was = this.isOpen;
    this.isOpen = false;
    this._queue = [];
    for (const id of [...this._replies.keys()]) {
      this._settle(id, { ok: false, error: "the connection to the viewer's server was lost" });
    }
    this.emit("close", { was, code: event.code, reason: event.reason });
    this._timer = setTimeout(() => this._open(), this._delay * (0.75 + Math.random() / 2));
    this._delay = Math.min(2 * this._delay, LONGEST_DELAY_MS);
  }

  _tryNow() {
    if (!this.isOpen && this._timer) this._open();
  }

  /** A connection whose other end vanished stays "open" for minutes; nothing comes on it. */
  _giveUpIfSilent() {
    const opening = this._socket.readyState === WebSocket.CONNECTING;
    if (this._timer || !(this._ticks || opening)) return;
    if (performance.now() - this._heardAt < SILENCE_MS) return;
    const socket = this._socket;
    socket.close();
    this._closed(socket, { code: 0, reason: "silent" });
  }

  _refill() {
    this._credit = Math.min(BURST, this._credit + 1);
    this._flush();
  }

  _flush() {
    while (this.isOpen && this._queue.length && this._credit >= 1) {
      this._credit -= 1;
      this._socket.send(JSON.stringify(this._queue.shift()));
    }
  }

  _settle(id, reply) {
    const waiting = this._replies.get(id);
    if (!waiting) return;
    clearTimeout(waiting.timer);
    this._replies.delete(id);
    waiting.resolve(reply);
  }
}
