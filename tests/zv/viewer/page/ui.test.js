import assert from "node:assert/strict";
import test from "node:test";

import { duration, rate, shownRate, size } from "./ui/format.js";

test("durations have few digits and a unit", () => {
  assert.deepEqual([null, 0.4, 12.3, 1340, 42_000, 250_000, 3_900_000, 90_000_000].map(duration),
    ["–", "0 ms", "12 ms", "1.3 s", "42 s", "4 min 10 s", "1 h 05 min", "1 d 1 h"]);
});

test("rates and sizes are short", () => {
  assert.deepEqual([null, 0, 0.25, 29.97, 120.4].map(rate),
    ["–", "0.0 Hz", "0.25 Hz", "30.0 Hz", "120 Hz"]);
  assert.deepEqual([12, 3400, 34_000, 1_200_000].map(size), ["12 B", "3.4 kB", "34 kB", "1.2 MB"]);
});

test("a rate says how much of it arrives, if that is clearly less", () => {
  assert.deepEqual([[8, 8], [1.25, 8], [7.9, 8], [null, 8], [null, null], [0.5, 2]]
    .map(([arriving, all]) => shownRate(arriving, all)),
    ["8.0 Hz", "1.3 of 8.0 Hz", "8.0 Hz", "8.0 Hz", "–", "0.50 of 2.0 Hz"]);
});
