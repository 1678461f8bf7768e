import assert from "node:assert/strict";
import test from "node:test";
import { inflateSync } from "node:zlib";

import { streamAddress } from "./export/addresses.js";
import { crc32, depthPng } from "./export/png.js";
import { KEYWORD, withHeader } from "./export/saving.js";

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

test("the values of a depth picture become a PNG of 16 bits", async () => {
  const values = [2345, 0, 65_535, 256, 1, 40_000]; // 3 x 2
  const data = Uint8ClampedArray.from(values.flatMap((value) => [value >> 8, value & 255, 7, 255]));
  const png = Buffer.from(await depthPng({ data, width: 3, height: 2 }));
  assert.equal(png.toString("latin1", 1, 4), "PNG");
  const chunks = {};
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    const length = png.readUInt32BE(at);
    chunks[png.toString("latin1", at + 4, at + 8)] = png.subarray(at + 8, at + 8 + length);
    assert.equal(png.readUInt32BE(at + 8 + length), crc32(png.subarray(at + 4, at + 8 + length)));
  }
  const { IHDR, IDAT } = chunks;
  assert.deepEqual([IHDR.readUInt32BE(0), IHDR.readUInt32BE(4), IHDR[8], IHDR[9]], [3, 2, 16, 0]);
  const rows = inflateSync(IDAT);
  assert.deepEqual([rows[0], rows[7]], [0, 0]); // no filter
  const read = [1, 3, 5, 8, 10, 12].map((at) => rows.readUInt16BE(at));
  assert.deepEqual(read, values);
  assert.deepEqual(Object.keys(chunks), ["IHDR", "IDAT", "IEND"]);
});

test("an address has the choice of size, and never a token", () => {
  const key = "vision/front/image/compressed";
  assert.equal(streamAddress("http://h:8080", key, { width: null, quality: null }),
    "http://h:8080/stream?topic=/vision/front/image/compressed");
  assert.equal(streamAddress("https://h", key, { width: 320, quality: 40 }, false, "snapshot"),
    "https://h/snapshot?topic=/vision/front/image/compressed&width=320&quality=40");
  assert.equal(streamAddress("http://h", "v/a b&token=x/image", { width: null, quality: null }, true),
    "http://h/stream?topic=/v/a%20b%26token%3Dx/image&default_transport=raw");
});
