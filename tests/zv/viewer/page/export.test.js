import assert from "node:assert/strict";
import test from "node:test";

import { crc32, KEYWORD, withHeader } from "./export/saving.js";

test("CRC-32 is that of PNG", () => {
  // The check value of ISO 3309 for "123456789", and the CRC of every IEND chunk.
  assert.equal(crc32(new TextEncoder().encode("123456789")), 0xcbf43926);
  assert.equal(crc32(new TextEncoder().encode("IEND")), 0xae426082);
});

test("a header stands in a JPEG behind its APPn segments, and the rest stays", () => {
  const jpeg = Uint8Array.of(0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xdb, 9, 9);
  const parts = withHeader(jpeg, "image/jpeg", { seq: 7, node: "é" });
  const made = Uint8Array.from(parts.flatMap((part) => [...part]));
  const text = `${KEYWORD} {"seq":7,"node":"\\u00e9"}`;
  assert.deepEqual([...made.subarray(0, 8)], [...jpeg.subarray(0, 8)]);
  assert.deepEqual([...made.subarray(8, 12)], [0xff, 0xfe, 0, text.length + 2]);
  assert.equal(new TextDecoder().decode(made.subarray(12, 12 + text.length)), text);
  assert.deepEqual([...made.subarray(12 + text.length)], [...jpeg.subarray(8)]);
});
