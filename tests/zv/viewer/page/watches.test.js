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

test("two who want the messages of a stream watch it once, and each gets its own until it ends", (t) => {
  t.mock.timers.enable({ apis: ["setTimeout"] });
  const sent = [];
  const connection = Object.assign(new Events(), { isOpen: true, send: (one) => sent.push(one) });
  const watches = new Watches(connection);
  const got = [];
  const [one, other] = ["one", "other"].map((name) => ({ key }) => got.push(`${name} ${key}`));
  watches.watchMessages(["a", "b"], one);
  watches.watchMessages(["a"], other);
  t.mock.timers.tick(100);
  assert.deepEqual(sent.splice(0), [{ op: "watch", key: "a" }, { op: "watch", key: "b" }]);
  for (const key of ["a", "b", "c"]) connection.emit("message", { key });
  assert.deepEqual(got.splice(0), ["one a", "other a", "one b"]);
  watches.watchMessages([], one);
  t.mock.timers.tick(100);
  assert.deepEqual(sent.splice(0), [{ op: "unwatch", key: "b" }]);
  connection.emit("message", { key: "a" });
  assert.deepEqual(got, ["other a"]);
  watches.watchMessages(["a"], other); // as before
  watches.watchMessages([], other);
  t.mock.timers.tick(100);
  assert.deepEqual(sent, [{ op: "unwatch", key: "a" }]);
});
