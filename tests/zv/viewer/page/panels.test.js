import assert from "node:assert/strict";
import test from "node:test";

import { bend, locked, parse, positionOf, STEPS, valueAt } from "./panels/controls.js";
import { numericFields } from "./model/fields.js";
import { columns, lonely } from "./panels/chart.js";
import { FieldRecorder } from "./panels/field_recorder.js";
import { layOut } from "./panels/graph.js";
import { condition } from "./panels/parameters.js";
import { linesOf } from "./panels/plots.js";

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

test("a slider keeps to the steps of a device's control", () => {
  const focus = { type: "int", minimum: 0, maximum: 250, default: 0, step: 5 };
  for (let position = 0; position <= STEPS; position += 7) {
    assert.equal(valueAt(focus, position) % 5, 0);
  }
  assert.equal(valueAt(focus, STEPS), 250);
});

test("what cannot be set now says why, and what changes by itself can be set", () => {
  assert.equal(locked({ flags: ["inactive", "volatile"] }), "without effect now");
  assert.equal(locked({ flags: ["read_only"] }), "only read");
  assert.equal(locked({ flags: ["volatile"] }), "");
  assert.equal(locked({}), "");
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
const MATCHES = new Map([["v/*/image/compressed", ["v/front/image/compressed"]],
  ["v/**", ["v/front/centroid", "v/front/image/compressed", "v/front/truth"]]]);
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

test("a key may have the name of something that every object has", () => {
  for (const name of ["constructor", "__proto__", "toString"]) {
    const { rows } = layOut([{ ...TRACKER, subscribes: [name] }], new Map());
    assert.deepEqual(rows.map((row) => row.key), ["v/front/centroid", name]);
  }
});

test("the numbers of any message have names joined by dots, and are bounded", () => {
  const header = { camera: "front", epoch: "1790", seq: 7, width: 640 };
  const body = { mean: 3.5, moving: true, name: "x", none: null, box: [1, 2],
    tracks: [{ id: 4, vx: -0.5, world: null }], done_ns: "1790000000000000000",
    step_ns: ["-5", "6"], large: "9007199254740993", serial: "12", room: "7e3", time_ns: "soon" };
  assert.deepEqual([...numericFields({ header, body })], [["mean", 3.5], ["moving", 1],
    ["box.0", 1], ["box.1", 2], ["tracks.0.id", 4], ["tracks.0.vx", -0.5],
    ["done_ns", 1.79e18], ["step_ns.0", -5], ["step_ns.1", 6], ["large", 9007199254740992],
    ["header.epoch", 1790], ["header.seq", 7], ["header.width", 640]]);
  const wide = Object.fromEntries(Array.from({ length: 500 }, (_, index) => [`f${index}`, index]));
  assert.equal(numericFields({ body: wide }).size, 64);
  assert.equal(numericFields({ body: { list: Array(500).fill(1) } }).size, 16);
  let deep = 1;
  for (let level = 0; level < 100; level += 1) deep = { a: deep };
  assert.equal(numericFields({ body: deep }).size, 0);
  for (const strange of [null, undefined, 5, "x"]) {
    assert.equal(numericFields({ header: strange, body: strange }).size, 0);
  }
});

test("only chosen numbers of the chosen camera are kept, and nothing is watched for no topic", () => {
  let watched;
  let tell;
  const watches = { watchMessages: (keys, receive) => [watched, tell] = [keys, receive] };
  const message = (camera, topic) => ({ kind: "message", camera, topic, key: `v/${camera}/${topic}` });
  const streams = [message("front", "brightness"), message("front", "centroid"),
    message("rear", "brightness")];
  const recorder = new FieldRecorder({ streams }, watches);
  recorder.follow("front", ["brightness"], [["brightness", "mean"]]);
  assert.deepEqual(watched, ["v/front/brightness"]);
  tell({ key: watched[0], header: {}, body: { mean: 9, min: 2 } });
  tell({ key: watched[0], header: {}, body: { mean: "none", min: 2 } });
  assert.deepEqual(recorder.points("brightness", "mean").map(({ value }) => value), [9]);
  assert.deepEqual(recorder.known.get("brightness"), ["min"]);
  recorder.follow("front", [], [["brightness", "mean"]]); // the panel is closed
  assert.deepEqual([watched.length, recorder.points("brightness", "mean").length], [0, 1]);
  recorder.follow("rear", ["brightness"], [["brightness", "mean"]]);
  assert.deepEqual(watched, ["v/rear/brightness"]);
  assert.deepEqual(recorder.points("brightness", "mean"), []);
});

test("a value stands where it came, whatever the camera's clock says, and after a gap apart", (t) => {
  let now = 1000;
  t.mock.method(performance, "now", () => now);
  const recorder = new FieldRecorder({ streams: [] }, { watchMessages() {} });
  recorder.follow("front", [], [["centroid", "x"]]);
  for (const [at, x] of [[1000, 100], [1100, 400], [121_000, 100], [121_100, 400]]) {
    now = at;
    recorder.take("centroid", { header: { stamp_ns: "5" }, body: { x } });
  }
  const points = recorder.points("centroid", "x");
  assert.deepEqual(points.map(({ at }) => at), [1000, 1100, 121_000, 121_100]);
  assert.deepEqual(columns(points)[1], [100, 400, null, 100, 400]);
});

/** A recorder of `mean`, and what it keeps of these [ms, value]. */
function recorded(points) {
  const recorder = new FieldRecorder({ streams: [] }, { watchMessages() {} });
  recorder.follow("front", [], [["brightness", "mean"]]);
  for (const [at, mean] of points) recorder.take("brightness", { body: { mean } }, at);
  return recorder.points("brightness", "mean").map(({ at, value }) => [at, value]);
}

test("of fast messages each spike is kept, few points are drawn, and they stay while more come", () => {
  const fast = Array.from({ length: 186_000 }, (_, index) => [index * 10, index % 7]); // 31 min, 100 Hz
  fast[20_001] = [200_010, -500];
  fast[30_002] = [300_020, 900];
  const points = recorded(fast);
  assert.ok(points.length <= 3 * 30 * 60 * 4 + 3);
  assert.ok(points[0][0] >= 59_700 && points.at(-1)[0] === 1_859_990); // of the last 30 minutes
  for (const spike of [fast[20_001], fast[30_002]]) assert.ok(points.some((one) => `${one}` === `${spike}`));
  const later = recorded([...fast, [1_860_000, 1]]);
  assert.deepEqual(later.slice(0, -1).slice(-3000), points.slice(-3000));
});

test("of a part of the time one quarter of a second before it is drawn too, or the newest of all", () => {
  const recorder = new FieldRecorder({ streams: [] }, { watchMessages() {} });
  recorder.follow("front", [], [["brightness", "mean"]]);
  for (const at of [1000, 2000, 3000]) recorder.take("brightness", { body: { mean: 5 } }, at);
  const from = (moment) => recorder.points("brightness", "mean", moment).map(({ at }) => at);
  assert.deepEqual([from(0), from(2500), from(9000)], [[1000, 2000, 3000], [2000, 3000], [3000]]);
});

test("points of slow messages are joined, and a line is broken where they fail to come", () => {
  const values = (times) => columns(times.map((at) => ({ at, value: at })))[1];
  assert.deepEqual(values([0, 5000, 10_000, 15_000]), [0, 5000, 10_000, 15_000]); // 0.2 Hz
  assert.deepEqual(values([0, 60_000, 120_000]), [0, 60_000, 120_000]);
  assert.deepEqual(values([0, 5000, 10_000, 15_000, 31_000]), [0, 5000, 10_000, 15_000, null, 31_000]);
  assert.deepEqual(values([0, 100, 200, 3600, 7200]), [0, 100, 200, 3600, null, 7200]); // 3.4 s, 3.6 s
  const points = [0, 1000, 2000, 8000].map((at, value) => ({ at, value }));
  assert.deepEqual(columns(points, 100), [[100, 1100, 2100, 5100, 8100], [0, 1, 2, null, 3]]);
  assert.deepEqual(columns([]), [[], []]);
});

test("a value with none beside it is drawn as a dot, whatever other lines have between", () => {
  assert.deepEqual(lonely([1, undefined, null, undefined, 5, null, 7, undefined, 8]), [0, 4]);
  assert.deepEqual([lonely([3]), lonely([]), lonely([1, 2])], [[0], [], []]);
});

test("a line of a node that serves several cameras says that it is of all of them", () => {
  const nodes = [
    { node: "camera_left", service: "camera", cameras: ["left"] },
    { node: "camera_right", service: "camera", cameras: ["right"] },
    { node: "tracker", service: "tracker", cameras: ["left", "right"] },
  ];
  const histories = new Map([["tracker", [{ at: 5, rate: 60 }]]]);
  const lines = linesOf({ nodes, histories }, "left", ["rate"], (name) => name);
  assert.deepEqual(lines.map(({ name, points }) => [name, points]),
    [["camera", []], ["tracker (all 2 cameras)", [{ at: 5, value: 60 }]]]);
});

test("a parameter of another pipeline or detector says with which it counts", () => {
  const pipeline = { name: "pipeline", choices: ["robust", "tutorial"], value: "robust" };
  const detector = { name: "detector", choices: ["canny", "sobel", "colour", "learned"], value: "canny" };
  const all = [pipeline, detector, { name: "low", choices: null }];
  const of = (description) => condition({ description }, all);
  assert.equal(of("tutorial: number of frames"), "only with pipeline = tutorial");
  assert.equal(of("robust: keep the background"), "");
  assert.equal(of("of canny: gradients below it"), "");
  assert.equal(of("of colour and learned, their only parameter: wanted share"),
    "only with detector = colour or learned");
  assert.equal(of("of canny and sobel: both"), "");
  assert.equal(of("zones: polygons"), "");
  assert.equal(of("time in a zone"), "");
  assert.equal(of(undefined), "");
});
