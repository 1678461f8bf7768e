import assert from "node:assert/strict";
import test from "node:test";

import { drawOverlay, marksOf, Trails } from "./video/overlay.js";

test("a trail ends with its frame and is two seconds long", () => {
  const trails = new Trails();
  const stamp = (seq) => String(BigInt(seq) * 100_000_000n);
  for (let seq = 0; seq < 60; seq += 1) {
    const body = { x: seq, y: 0, box: [0, 0, 1, 1] };
    trails.add("centroid", { epoch: "1", seq, stamp_ns: stamp(seq) }, body);
  }
  const points = trails.upTo("centroid", { epoch: "1", seq: 50, stamp_ns: stamp(50) }).get("");
  assert.deepEqual([points.length, points[0][0], points.at(-1)[0]], [21, 30, 50]);
  assert.equal(trails.upTo("centroid", { epoch: "2", seq: 50, stamp_ns: stamp(50) }).size, 0);
});

test("a centroid of nothing marks nothing", () => {
  assert.deepEqual(marksOf({ x: null, y: null, box: null, area: null }), []);
});

const TRACK = { id: 7, state: "lost", x: 1.5, y: 2, box: [0, 0, 3, 4] };

test("a centroid and tracks mark their boxes", () => {
  assert.deepEqual(marksOf({ x: 3, y: 4, box: [1, 2, 5, 6], area: 9 }),
    [{ id: "", label: "3, 4", x: 3, y: 4, box: [1, 2, 5, 6], state: "confirmed" }]);
  assert.deepEqual(marksOf({ tracks: [TRACK, { ...TRACK, id: 8, state: "confirmed" }] })
    .map(({ id, label }) => [id, label]), [[7, "7 lost"], [8, "8"]]);
});

test("a track of a model is labelled with its class and score", () => {
  const car = { ...TRACK, class: "car", score: 0.874 };
  const labels = marksOf({ tracks: [car, { ...car, state: "confirmed" }, { ...car, score: "x" },
    { ...car, class: 5 }] }).map(({ label }) => label);
  assert.deepEqual(labels, ["7 car 87% lost", "7 car 87%", "7 car lost", "7 lost"]);
});

test("what is no place marks nothing and does not stop the rest", () => {
  for (const box of [null, 5, {}, { length: 4 }, "abcd", [1, 2, 3], [1, 2, 3, null], [1, 2, 3, "4"]]) {
    assert.deepEqual(marksOf({ x: 3, y: 4, box }), []);
    assert.deepEqual(marksOf({ tracks: [{ ...TRACK, box }, null, 5, "x", TRACK] }).length, 1);
  }
  for (const body of [{}, { x: 3, y: 4 }, { x: "3", y: 4, box: [1, 2, 3, 4] }, { tracks: {} }]) {
    assert.deepEqual(marksOf(body), []);
  }
});

/** A canvas that takes everything and keeps the texts. */
function canvasWith(texts) {
  return new Proxy({}, { get: (_, name) => (...given) => {
    if (name === "fillText") texts.push(given[0]);
    return { width: 9 };
  }, set: () => true });
}

test("states and shapes may have the names of what every object has", () => {
  for (const name of ["constructor", "__proto__", "toString"]) {
    const texts = [];
    const frame = { header: { width: 640 }, items: new Map([["t", { tracks: [{ ...TRACK, state: name }] }]]) };
    const zone = { name, world: false, points: [[0, 0], [9, 0], [9, 9]] };
    const shapes = { zones: [zone], lines: [], counts: { zones: {} } };
    drawOverlay(canvasWith(texts), frame, { keys: ["t"], trails: null, shapes }, (point) => point);
    assert.deepEqual(texts, [name, `7 ${name}`]);
  }
});
