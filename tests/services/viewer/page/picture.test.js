import assert from "node:assert/strict";
import test from "node:test";

import { crc32, KEYWORD, withHeader } from "./embedding.js";
import { marksOf, Trails } from "./trails.js";
import { fit, panned, toFrame, toPane, zoomed } from "./viewport.js";
import { between, milliseconds, readPicture } from "./wire.js";

const FRAME = { width: 640, height: 480 };
const PANE = { width: 1280, height: 720 };

test("a binary message is its length, its JSON and the picture", () => {
  const json = new TextEncoder().encode('{"key":"k","age_ms":4.5,"header":{"epoch":"9007199254740993"}}');
  const bytes = new Uint8Array(4 + json.length + 3);
  new DataView(bytes.buffer).setUint32(0, json.length, true);
  bytes.set(json, 4);
  bytes.set([0xff, 0xd8, 7], 4 + json.length);
  const picture = readPicture(bytes.buffer);
  assert.equal(picture.ageMs, 4.5);
  assert.equal(picture.header.epoch, "9007199254740993"); // 2^53 + 1, which no number holds
  assert.deepEqual([...picture.data], [0xff, 0xd8, 7]);
});

test("a binary message that is cut short is refused", () => {
  assert.throws(() => readPicture(Uint8Array.of(200, 0, 0, 0, 123).buffer), RangeError);
});

test("times of 64 bits keep their milliseconds", () => {
  assert.equal(milliseconds("1790000000123456789"), 1790000000123.4568);
  assert.equal(between("1790000000000000001", "1790000000033000001"), 33);
  assert.equal(milliseconds(null), null);
});

test("a whole frame fits into its pane and stands in the middle", () => {
  const view = fit(FRAME, PANE); // 720 / 480 = 1.5, so 960 pixels wide: 160 are left each side
  assert.equal(view.scale, 1.5);
  assert.deepEqual(toPane(view, PANE, { x: 0, y: 0 }), { x: 160, y: 0 });
  assert.deepEqual(toPane(view, PANE, { x: 640, y: 480 }), { x: 1120, y: 720 });
});

test("zooming keeps the point under the pointer", () => {
  const view = fit(FRAME, PANE);
  const at = { x: 400, y: 300 };
  const before = toFrame(view, PANE, at);
  const after = toFrame(zoomed(view, FRAME, PANE, 3, at), PANE, at);
  assert.ok(Math.hypot(before.x - after.x, before.y - after.y) < 1e-9);
});

test("a frame cannot be dragged out of sight", () => {
  const view = panned({ scale: 2, x: 320, y: 240 }, FRAME, 1e6, -1e6);
  assert.deepEqual(view, { scale: 2, x: 0, y: 480 });
});

test("CRC-32 is that of PNG", () => {
  // The check value of ISO 3309 for "123456789", and the CRC of every IEND chunk.
  assert.equal(crc32(new TextEncoder().encode("123456789")), 0xcbf43926);
  assert.equal(crc32(new TextEncoder().encode("IEND")), 0xae426082);
});

test("a header stands in a JPEG behind its APPn segments, and the rest stays", () => {
  const jpeg = Uint8Array.of(0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xdb, 9, 9);
  const made = withHeader(jpeg, "image/jpeg", { seq: 7, node: "é" });
  const text = `${KEYWORD} {"seq":7,"node":"\\u00e9"}`;
  assert.deepEqual([...made.subarray(0, 8)], [...jpeg.subarray(0, 8)]);
  assert.deepEqual([...made.subarray(8, 12)], [0xff, 0xfe, 0, text.length + 2]);
  assert.equal(new TextDecoder().decode(made.subarray(12, 12 + text.length)), text);
  assert.deepEqual([...made.subarray(12 + text.length)], [...jpeg.subarray(8)]);
});

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

test("what is no place marks nothing and does not stop the rest", () => {
  for (const box of [null, 5, {}, { length: 4 }, "abcd", [1, 2, 3], [1, 2, 3, null], [1, 2, 3, "4"]]) {
    assert.deepEqual(marksOf({ x: 3, y: 4, box }), []);
    assert.deepEqual(marksOf({ tracks: [{ ...TRACK, box }, null, 5, "x", TRACK] }).length, 1);
  }
  for (const body of [{}, { x: 3, y: 4 }, { x: "3", y: 4, box: [1, 2, 3, 4] }, { tracks: {} }]) {
    assert.deepEqual(marksOf(body), []);
  }
});
