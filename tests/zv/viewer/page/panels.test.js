import assert from "node:assert/strict";
import test from "node:test";

import { bend, parse, positionOf, STEPS, valueAt } from "./panels/controls.js";
import { layOut } from "./panels/graph.js";
import { axis } from "./panels/plots.js";

const LOW = { type: "float", minimum: 0, maximum: 100_000, default: 40 };
const QUALITY = { type: "int", minimum: 1, maximum: 100, default: 80 };

test("a slider's ends are the parameter's", () => {
  for (const parameter of [LOW, QUALITY]) {
    assert.equal(valueAt(parameter, 0), parameter.minimum);
    assert.equal(valueAt(parameter, STEPS), parameter.maximum);
  }
});

test("a default far below the maximum stands at 40 % of its slider", () => {
  assert.equal(positionOf(LOW, 40), 400);
  assert.equal(valueAt(LOW, 400), 40);
  assert.equal(bend(QUALITY), 1);
});

test("a slider's place and value belong together", () => {
  for (const value of [1, 20, 57, 80, 100]) {
    assert.equal(valueAt(QUALITY, positionOf(QUALITY, value)), value);
  }
});

test("an empty field is no value, unless the parameter may be unset", () => {
  assert.equal(parse({ type: "int", default: null }, ""), null);
  assert.equal(parse({ type: "int", default: 3 }, ""), "");
  assert.equal(parse({ type: "float", default: 3 }, "1.5"), 1.5);
  assert.equal(parse({ type: "int", default: 3 }, "5"), 5);
});

const CAMERA = { node: "camera_front", publishes: ["v/front/image/compressed", "v/front/truth"],
  subscribes: [] };
const TRACKER = { node: "tracker_front", publishes: ["v/front/centroid"],
  subscribes: ["v/front/image/compressed"] };
const MATCHES = { "v/*/image/compressed": ["v/front/image/compressed"],
  "v/**": ["v/front/centroid", "v/front/image/compressed", "v/front/truth"] };
const VIEWER = { node: "viewer", publishes: [], subscribes: ["v/*/image/compressed", "v/**"] };

test("the graph has a row for each key with who sends and who hears it", () => {
  const { rows, senders, receivers } = layOut([CAMERA, TRACKER, VIEWER], MATCHES);
  assert.deepEqual(rows.map(({ key, sender, receivers: heard }) => [key, sender, heard]), [
    ["v/front/image/compressed", "camera_front", ["tracker_front", "viewer"]],
    ["v/front/truth", "camera_front", ["viewer"]],
    ["v/front/centroid", "tracker_front", ["viewer"]],
  ]);
  assert.deepEqual(senders.map((one) => one.node), ["camera_front", "tracker_front"]);
  assert.deepEqual(receivers.map((one) => one.node).sort(), ["tracker_front", "viewer"]);
});

test("a key that nobody sends is in the graph too", () => {
  const { rows } = layOut([TRACKER]);
  assert.deepEqual(rows.filter((row) => row.sender === null).map((row) => row.key),
    ["v/front/image/compressed"]);
});

test("an expression that the server did not match stands for itself, however deep it is", () => {
  const deep = { ...VIEWER, subscribes: [`v/${"**/*/".repeat(12)}x`] };
  const { rows } = layOut([CAMERA, deep]);
  assert.deepEqual(rows.filter((row) => row.receivers.length).map((row) => [row.key, row.sender]),
    [[deep.subscribes[0], null]]);
});

test("a scale begins at 0 and ends at a round number above all values", () => {
  assert.deepEqual(axis([3, null, 29.9]), { high: 30, ticks: [0, 10, 20, 30] });
  assert.deepEqual(axis([]).ticks[0], 0);
  for (const top of [0.02, 1, 7.3, 480, 12_345]) {
    const { high, ticks } = axis([top]);
    assert.ok(high >= top && ticks.length >= 2 && ticks.length <= 6, `${top}: ${ticks}`);
  }
});
