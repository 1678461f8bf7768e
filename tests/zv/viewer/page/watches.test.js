import assert from "node:assert/strict";
import test from "node:test";

globalThis.document = { addEventListener() {}, hidden: false };
const { Events } = await import("./transport/connection.js");
const { Watches } = await import("./video/watches.js");

test("a watch that the server refused is tried again after a while", (t) => {
  t.mock.timers.enable({ apis: ["setTimeout"] });
  const sent = [];
  const connection = Object.assign(new Events(), { isOpen: true, send: (one) => sent.push(one) });
  const watches = new Watches(connection);
  const end = watches.watchPictures("a", null, {}, () => {});
  watches.watchPictures("b", null, {}, () => {});
  t.mock.timers.tick(100);
  assert.deepEqual(sent.splice(0), [{ op: "watch", key: "a" }, { op: "watch", key: "b" }]);
  connection.emit("error", { key: "a", text: "too many" });
  connection.emit("error", { text: "another" });
  t.mock.timers.tick(4000);
  assert.deepEqual(sent, []);
  t.mock.timers.tick(1000);
  assert.deepEqual(sent.splice(0), [{ op: "watch", key: "a" }]);
  connection.emit("error", { key: "a", text: "too many" });
  end(); // nobody wants it any more
  t.mock.timers.tick(6000);
  assert.deepEqual(sent, [{ op: "unwatch", key: "a" }]);
});
