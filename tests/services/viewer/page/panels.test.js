import assert from "node:assert/strict";
import test from "node:test";

import { Events } from "./events.js";
import { layOut, matches } from "./layering.js";
import { inOrder, overlayStreams, topicName } from "./naming.js";
import { bend, placeOf, STEPS, typed, valueAt } from "./scale.js";
import { System } from "./system.js";

const LOW = { type: "float", minimum: 0, maximum: 100_000, default: 40 };
const QUALITY = { type: "int", minimum: 1, maximum: 100, default: 80 };

test("a slider's ends are the parameter's", () => {
  for (const parameter of [LOW, QUALITY]) {
    assert.equal(valueAt(parameter, 0), parameter.minimum);
    assert.equal(valueAt(parameter, STEPS), parameter.maximum);
  }
});

test("a default far below the maximum stands at 40 % of its slider", () => {
  assert.equal(placeOf(LOW, 40), 400);
  assert.equal(valueAt(LOW, 400), 40);
  assert.equal(bend(QUALITY), 1);
});

test("a slider's place and value belong together", () => {
  for (const value of [1, 20, 57, 80, 100]) {
    assert.equal(valueAt(QUALITY, placeOf(QUALITY, value)), value);
  }
});

test("an empty field is no value, unless the parameter may be unset", () => {
  assert.equal(typed({ type: "int", default: null }, ""), null);
  assert.equal(typed({ type: "int", default: 3 }, ""), "");
  assert.equal(typed({ type: "float", default: 3 }, "1.5"), 1.5);
  assert.equal(typed({ type: "int", default: 3 }, "5"), 5);
});

const CAMERA = { node: "camera_front", publishes: ["v/front/image/compressed", "v/front/truth"],
  subscribes: [] };
const TRACKER = { node: "tracker_front", publishes: ["v/front/centroid"],
  subscribes: ["v/front/image/compressed"] };
const VIEWER = { node: "viewer", publishes: [], subscribes: ["v/*/image/compressed", "v/**"] };

test("the graph has a row for each key with who sends and who hears it", () => {
  const { rows, senders, receivers } = layOut([CAMERA, TRACKER, VIEWER]);
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

test("key expressions match as Zenoh's do", () => {
  assert.ok(matches("v/*/image", "v/front/image"));
  assert.ok(matches("v/**", "v/front/image"));
  assert.ok(matches("v/**/image", "v/image"));
  assert.ok(!matches("v/*", "v/front/image"));
  assert.ok(!matches("**", "@v/node/x"));
});

const STREAMS = ["mask/compressed", "image/compressed", "edges/smoothed/compressed", "image"]
  .flatMap((topic) => ["rear", "front"].map((camera) => ({ kind: "picture", topic, camera,
    live: true, type: "image/jpeg", key: `v/${camera}/${topic}` })));

test("the wall begins with all cameras, then what is made of them", () => {
  assert.deepEqual(inOrder(STREAMS).map((stream) => `${stream.camera} ${topicName(stream)}`), [
    "front image", "rear image", "front mask", "rear mask", "front smoothed", "rear smoothed",
    "front raw", "rear raw"]);
});

test("overlays are the centroid and all tracks of the same camera", () => {
  const message = (camera, topic, type) => ({ kind: "message", camera, topic, type });
  const streams = [...STREAMS, message("front", "truth", "vision.Tracks.v1"),
    message("front", "centroid", "vision.Centroid.v1"),
    message("front", "events", "vision.TrackEvent.v1"),
    message("rear", "centroid", "vision.Centroid.v1")];
  assert.deepEqual(overlayStreams(streams, "front").map((stream) => stream.topic),
    ["centroid", "truth"]);
});

test("of the log the last 1000 lines are kept, and none from before a new greeting", () => {
  const connection = new Events();
  const system = new System(connection);
  const line = (number) => ({ at_ns: String(number), level: "INFO", node: "", text: `${number}` });
  for (let number = 0; number < 1500; number += 1) connection.emit("log", line(number));
  assert.equal(system.lines.length, 1000);
  assert.deepEqual([system.lines[0].text, system.lines.at(-1).text], ["500", "1499"]);
  connection.emit("hello", { version: "0", now_ns: "0" });
  assert.deepEqual(system.lines, []);
});
