import assert from "node:assert/strict";
import test from "node:test";

import { automaticRange, histogramOf, paintTone, valuesOf, valueText } from "./video/tone.js";

const GREY = { header: { encoding: "mono8" } };
const COLOUR = { header: { encoding: "bgr8" } };
const DEPTH = { header: { encoding: "16UC1" }, depth: { min: 2000, max: 3000, values: true } };

/** RGBA pixels of triples. */
function pixels(...triples) {
  return Uint8ClampedArray.from(triples.flatMap((triple) => [...triple, 255]));
}

/** RGBA pixels as the server sends values of 16 bits; the blue one is its grey, not used here. */
function depths(...values) {
  return pixels(...values.map((value) => [value >> 8, value & 255, 9]));
}

test("a range is stretched over black to white in each channel of a colour picture", () => {
  const data = pixels([40, 140, 90], [0, 255, 240]);
  paintTone(data, valuesOf(COLOUR), { low: 40, high: 140, map: "viridis" });
  assert.deepEqual([...data], [0, 255, 128, 255, 0, 255, 255, 255]); // 50 of 100 is 127.5
});

test("a grey picture is coloured, from the first colour of a map to its last", () => {
  const data = pixels([10, 10, 10], [110, 110, 110], [200, 200, 200]);
  paintTone(data, valuesOf(GREY), { low: 10, high: 110, map: "viridis" });
  assert.deepEqual([...data], [0x44, 0x01, 0x54, 255, 0xfd, 0xe7, 0x25, 255, 0xfd, 0xe7, 0x25, 255]);
});

test("values of 16 bits are exact, and black without a reading", () => {
  const values = valuesOf(DEPTH);
  assert.deepEqual([values.of(0x09, 0x29, 77), values.unit], [2345, "mm"]);
  assert.ok(Number.isNaN(values.of(0, 0, 0)));
  const data = depths(2000, 0, 3000, 2500);
  paintTone(data, values, { low: 2000, high: 3000, map: "grey" });
  assert.deepEqual([0, 4, 8, 12].map((at) => data[at]), [0, 0, 255, 128]);
});

test("of depth that was sent as 8 bits, the values are those of its range", () => {
  const values = valuesOf({ ...DEPTH, depth: { min: 2000, max: 3000, values: false } });
  assert.deepEqual([1, 128, 255].map((level) => values.of(level)), [2000, 2500, 3000]);
  assert.ok(Number.isNaN(values.of(0)));
});

test("a histogram counts 8 bits from 0 to 255, and readings from the lowest to the highest", () => {
  const grey = histogramOf(pixels([0, 0, 0], [7, 7, 7], [7, 7, 7], [255, 255, 255]), valuesOf(GREY));
  assert.deepEqual([grey.low, grey.high, grey.total], [0, 255, 4]);
  assert.deepEqual([0, 7, 8, 255].map((bin) => grey.counts[bin]), [1, 2, 0, 1]);
  const depth = histogramOf(depths(0, 1000, 1000, 1255, 0), valuesOf(DEPTH));
  assert.deepEqual([depth.low, depth.high, depth.total], [1000, 1255, 3]);
  assert.deepEqual([0, 255].map((bin) => depth.counts[bin]), [2, 1]);
  const nothing = histogramOf(depths(0, 0), valuesOf(DEPTH));
  assert.deepEqual([nothing.low, nothing.high, nothing.total], [0, 0, 0]);
});

test("the automatic range leaves out the lowest and the highest percent", () => {
  const values = Array.from({ length: 1000 }, (_, index) => Math.floor(index / 4)); // 0 to 249
  const data = pixels(...values.map((value) => [value, value, value]));
  const { low, high } = automaticRange(histogramOf(data, valuesOf(GREY)));
  assert.deepEqual([low, high], [2, 247]); // of 4 each: 10 of 1000 reach 2, 990 reach 247
  const flat = automaticRange(histogramOf(pixels([9, 9, 9]), valuesOf(GREY)));
  assert.deepEqual(flat, { low: 9, high: 10 });
});

test("values have few digits and their unit", () => {
  assert.deepEqual([[2345, "mm"], [810.4, "mm"], [17.2, ""], [NaN, "mm"]].map((one) =>
    valueText(...one)), ["2.345 m", "810 mm", "17", "no reading"]);
});
