import assert from "node:assert/strict";
import test from "node:test";

import { between, Connection, milliseconds, PictureReader } from "./transport/connection.js";

/** The bytes of a message with a picture of three bytes. */
function message() {
  const text = '{"key":"k","age_ms":4.5,"bytes":3,"header":{"epoch":"9007199254740993"}}';
  const json = new TextEncoder().encode(text);
  const bytes = new Uint8Array(4 + json.length + 3);
  new DataView(bytes.buffer).setUint32(0, json.length, true);
  bytes.set(json, 4);
  bytes.set([0xff, 0xd8, 7], 4 + json.length);
  return bytes;
}

test("a binary message is its length, its JSON and the picture", () => {
  const picture = new PictureReader().add(message().buffer, 1);
  assert.equal(picture.ageMs, 4.5);
  assert.equal(picture.header.epoch, "9007199254740993"); // 2^53 + 1, which no number holds
  assert.deepEqual([...picture.data], [0xff, 0xd8, 7]);
});

test("a binary message that is cut short is refused", () => {
  const cut = Uint8Array.of(200, 0, 0, 0, 123).buffer;
  assert.throws(() => new PictureReader().add(cut, 1), RangeError);
});

test("a picture in parts is joined, is as old as its first part, and the next begins anew", () => {
  const bytes = message();
  const reader = new PictureReader();
  assert.equal(reader.add(bytes.slice(0, -3).buffer, 1), null);
  assert.equal(reader.add(bytes.slice(-3, -2).buffer, 2), null);
  const picture = reader.add(bytes.slice(-2).buffer, 3);
  assert.deepEqual([...picture.data], [0xff, 0xd8, 7]);
  assert.equal(picture.at, 1);
  assert.equal(reader.add(bytes.buffer, 4).at, 4);
});

test("times of 64 bits keep their milliseconds", () => {
  assert.equal(milliseconds("1790000000123456789"), 1790000000123.4568);
  assert.equal(between("1790000000000000001", "1790000000033000001"), 33);
  assert.equal(milliseconds(null), null);
});

test("a connection is given up when it is silent, not when the page stood still itself", (t) => {
  const sockets = [];
  let now = 0;
  let look;
  class Socket {
    constructor() {
      sockets.push(this);
    }
    close() {}
  }
  const stubs = { WebSocket: Socket, document: { addEventListener() {} } };
  stubs.setInterval = (listener) => (look = listener);
  stubs.setTimeout = () => 1;
  const kept = Object.fromEntries(Object.keys(stubs).map((name) => [name, globalThis[name]]));
  Object.assign(globalThis, stubs);
  t.mock.method(performance, "now", () => now);
  t.after(() => Object.assign(globalThis, kept));
  const closed = [];
  const connection = new Connection("ws://x/live");
  connection.on("close", () => closed.push(now));
  sockets[0].onopen();
  now = 60_000; // a minute in which the page did nothing; a tick that came meanwhile is read after
  look();
  sockets[0].onmessage({ data: '{"op":"tick"}' });
  now = 61_000;
  look();
  assert.deepEqual(closed, []);
  for (now = 62_000; now < 80_000; now += 1000) look();
  assert.deepEqual(closed, [67_000]); // silent for 6 s at 66, and still so at 67
});
