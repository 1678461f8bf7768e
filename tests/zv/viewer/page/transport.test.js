import assert from "node:assert/strict";
import test from "node:test";

import { between, milliseconds, readPicture } from "./transport/connection.js";

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
