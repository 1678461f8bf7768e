import assert from "node:assert/strict";
import test from "node:test";

import {
  isStep, overlayStreams, pictureStreams, staysBare, stepKeys, StreamStatistics, topicName,
} from "./model/streams.js";
import { System } from "./model/system.js";
import { Events } from "./transport/connection.js";

const PICTURE = { header: { epoch: "1" } };

test("the rate counts pictures that were not sent to this page", () => {
  const statistics = new StreamStatistics();
  // Every third of a stream at 30 Hz: one picture each 100 ms, two skipped before each.
  for (let now = 0; now <= 1000; now += 100) statistics.add(now, { ...PICTURE, skipped: 2 });
  assert.ok(Math.abs(statistics.rate(1000) - 30) < 0.01);
  assert.ok(Math.abs(statistics.arrivalRate(1000) - 10) < 0.01);
});

test("two pictures in quick succession, then a pause, have no rate", () => {
  const statistics = new StreamStatistics();
  statistics.add(0, PICTURE);
  statistics.add(170, { ...PICTURE, skipped: 23 });
  assert.equal(statistics.rate(1100), null);
  assert.equal(statistics.arrivalRate(1100), null);
});

test("a stream is live for a second after its last picture", () => {
  const statistics = new StreamStatistics();
  assert.equal(statistics.isLive(0), false);
  for (let now = 0; now <= 330; now += 33) statistics.add(now, PICTURE);
  assert.equal(statistics.isLive(1330), true);
  assert.equal(statistics.isLive(1331), false);
  assert.equal(statistics.rate(1331), null);
});

test("a slow stream is live for three of its frame times", () => {
  const statistics = new StreamStatistics();
  for (const now of [0, 2000, 4000]) statistics.add(now, PICTURE);
  assert.equal(statistics.isLive(10_000), true);
  assert.equal(statistics.isLive(10_001), false);
});

/** Statistics that saw ten pictures of epoch 1 in a second. */
function practised() {
  const statistics = new StreamStatistics();
  for (let now = 0; now < 1000; now += 100) statistics.add(now, PICTURE);
  return statistics;
}

test("one picture after a gap does not make the next gap usual", () => {
  const statistics = practised();
  statistics.add(60_900, PICTURE);
  assert.equal(statistics.isLive(61_900), true);
  assert.equal(statistics.isLive(61_901), false);
});

test("nor does it where few pictures came before", () => {
  const statistics = new StreamStatistics();
  for (const now of [0, 100, 60_100]) statistics.add(now, PICTURE);
  assert.equal(statistics.isLive(61_101), false);
});

test("a new epoch begins with no rate and nothing usual", () => {
  const statistics = new StreamStatistics();
  for (const now of [0, 9000, 18_000]) statistics.add(now, PICTURE);
  assert.equal(statistics.isLive(40_000), true);
  statistics.add(40_000, { header: { epoch: "2" } });
  assert.equal(statistics.rate(40_000), null);
  assert.equal(statistics.isLive(41_001), false);
  for (let now = 40_030; now < 41_000; now += 100) statistics.add(now, { header: { epoch: "2" } });
  assert.equal(statistics.rate(40_999), null);
  statistics.add(41_000, { header: { epoch: "2" } });
  assert.equal(statistics.rate(41_000), 11);
});

const STREAMS = ["mask/compressed", "image/compressed", "edges/smoothed/compressed", "image"]
  .flatMap((topic) => ["rear", "front"].map((camera) => ({ kind: "picture", topic, camera,
    live: true, type: "image/jpeg", key: `v/${camera}/${topic}` })));

test("the wall begins with all cameras, then what is made of them", () => {
  assert.deepEqual(pictureStreams(STREAMS).map((stream) => `${stream.camera} ${topicName(stream)}`), [
    "front image", "rear image", "front mask", "rear mask", "front smoothed", "rear smoothed",
    "front raw", "rear raw"]);
});

test("the steps of the edge detector stand between the camera's picture and the edges", () => {
  const streams = [...STREAMS, { ...STREAMS[0], topic: "edges/compressed", camera: "front",
    key: "v/front/edges/compressed" }];
  assert.deepEqual(stepKeys(streams, "front"), ["v/front/image/compressed",
    "v/front/edges/smoothed/compressed", "v/front/edges/compressed"]);
  assert.deepEqual(stepKeys(streams.filter((one) => !one.topic.includes("smoothed")), "front"), []);
  assert.deepEqual(stepKeys(streams, "side"), []);
});

test("a step is told from the picture and the edges", () => {
  const stepsOf = ["image", "edges", "edges/smoothed", "edges/thresholded", "tracked"]
    .filter((topic) => isStep({ kind: "picture", topic: `${topic}/compressed` }));
  assert.deepEqual(stepsOf, ["edges/smoothed", "edges/thresholded"]);
});

test("boxes stay away from a step, and from the edges beside one", () => {
  const [image, edges, step] = ["image", "edges", "edges/smoothed"]
    .map((topic) => ({ kind: "picture", topic: `${topic}/compressed` }));
  assert.equal(staysBare(step, [step]), true);
  assert.equal(staysBare(edges, [image, edges, step]), true);
  assert.equal(staysBare(edges, [image, edges]), false);
  assert.equal(staysBare(image, [image, edges, step]), false);
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

test("the clock is the server's, also after its step, and a late message is none", (t) => {
  let now = 0;
  t.mock.method(performance, "now", () => now);
  const connection = new Events();
  const system = new System(connection);
  const tick = (ms) => connection.emit("tick", { now_ns: `${ms}000000` });
  connection.emit("hello", { version: "0", now_ns: "1000000000000" }); // 1 000 000 ms
  for (const [passed, server, shown] of [
    [0, 1_002_000, 1_002_000], [2000, 1_003_700, 1_004_000], // 300 ms late
    [2000, 4_606_000, 4_606_000], [2000, 1_008_000, 1_008_000]]) { // an hour forth, and back
    now += passed;
    tick(server);
    assert.equal(system.now, shown);
  }
});

test("a report is as old as its arrival, whatever steps the server's clock makes", (t) => {
  let now = 50_000;
  t.mock.method(performance, "now", () => now);
  const connection = new Events();
  const system = new System(connection);
  const report = (ms) => connection.emit("health", { node: "a", diagnostics: {}, lost: 0,
    at_ns: `${ms}000000` });
  connection.emit("hello", { version: "0", now_ns: "9000000000000" });
  report(8_999_000); // a second before the page was opened
  assert.equal(system.report("a").at, 49_000);
  now = 51_000;
  connection.emit("tick", { now_ns: "5000000000000" }); // back by more than an hour
  report(5_000_000);
  assert.equal(system.report("a").at, 51_000);
  report(9_000_000); // forth again, before the next tick
  assert.equal(system.report("a").at, 51_000);
});

test("lost frames are those since the report a second before, and unknown after a gap", () => {
  const connection = new Events();
  const system = new System(connection);
  for (const [seconds, lost] of [[0, 5], [1, 7], [4, 8], [64, 600], [65, "601"], [66, 0]]) {
    const diagnostics = { counters: { "dropped.late": 7, "dropped.no_subscriber": 90 * seconds } };
    connection.emit("health", { node: "a", diagnostics, lost, at_ns: String(seconds * 1e9) });
  }
  assert.deepEqual(system.histories.get("a").map(({ drops }) => drops), [0, 2, 1, null, 1, 0]);
});
