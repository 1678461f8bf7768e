import assert from "node:assert/strict";
import test from "node:test";

import { Orientation } from "./model/orientation.js";

const FRAME = { width: 640, height: 480 };
const TEXTS = ["0", "90", "180", "270", "0m", "90m", "180m", "270m"];

test("a quarter clockwise puts the top left corner to the top right", () => {
  const turned = Orientation.of("90");
  assert.deepEqual(turned.size(FRAME), { width: 480, height: 640 });
  assert.deepEqual(turned.toTurned(FRAME, { x: 0, y: 0 }), { x: 480, y: 0 });
  assert.deepEqual(turned.toTurned(FRAME, { x: 640, y: 0 }), { x: 480, y: 640 });
});

test("half a turn exchanges opposite corners, a mirror left and right", () => {
  assert.deepEqual(Orientation.of("180").toTurned(FRAME, { x: 10, y: 20 }), { x: 630, y: 460 });
  assert.deepEqual(Orientation.of("0m").toTurned(FRAME, { x: 10, y: 20 }), { x: 630, y: 20 });
});

test("of every orientation, points come back and the canvas transform agrees", () => {
  const point = { x: 100.5, y: 7.5 };
  const places = TEXTS.map((text) => {
    const orientation = Orientation.of(text);
    const turned = orientation.toTurned(FRAME, point);
    assert.deepEqual(orientation.toFrame(FRAME, turned), point);
    const [a, b, c, d, e, f] = orientation.transform(FRAME);
    assert.deepEqual({ x: a * point.x + c * point.y + e, y: b * point.x + d * point.y + f }, turned);
    assert.equal(orientation.text, text);
    return JSON.stringify(turned);
  });
  assert.equal(new Set(places).size, 8);
});

test("rotating turns what is seen clockwise, flipping exchanges its left and right", () => {
  for (const text of TEXTS) {
    const before = Orientation.of(text);
    const seen = before.toTurned(FRAME, { x: 100, y: 30 });
    const { width, height } = before.size(FRAME);
    assert.deepEqual(before.rotated().toTurned(FRAME, { x: 100, y: 30 }),
      { x: height - seen.y, y: seen.x });
    assert.deepEqual(before.flipped().toTurned(FRAME, { x: 100, y: 30 }),
      { x: width - seen.x, y: seen.y });
  }
});

test("a text that is no orientation is that of the frame", () => {
  for (const text of ["", "45", "90x", "m", null, undefined, {}]) {
    assert.equal(Orientation.of(text).text, "0");
  }
});
