import assert from "node:assert/strict";
import test from "node:test";

import { axis } from "./chart.js";
import { duration, rate, size } from "./format.js";
import { Meter } from "./meter.js";

test("the rate counts pictures that were not sent to this page", () => {
  const meter = new Meter();
  // Every third of a stream at 30 Hz: one picture each 100 ms, two skipped before each.
  for (let now = 0; now <= 1000; now += 100) meter.add(now, { skipped: 2 });
  assert.ok(Math.abs(meter.rate(1000) - 30) < 0.01);
});

test("a stream is live for a second after its last picture", () => {
  const meter = new Meter();
  assert.equal(meter.isLive(0), false);
  for (let now = 0; now <= 330; now += 33) meter.add(now);
  assert.equal(meter.isLive(1330), true);
  assert.equal(meter.isLive(1331), false);
  assert.equal(meter.rate(1331), null);
});

test("a slow stream is live for three of its frame times", () => {
  const meter = new Meter();
  for (const now of [0, 2000, 4000]) meter.add(now);
  assert.equal(meter.isLive(10_000), true);
  assert.equal(meter.isLive(10_001), false);
});

/** A meter that saw ten pictures of epoch 1 in a second. */
function practised() {
  const meter = new Meter();
  for (let now = 0; now < 1000; now += 100) meter.add(now, { header: { epoch: "1" } });
  return meter;
}

test("one picture after a gap does not make the next gap usual", () => {
  const meter = practised();
  meter.add(60_900, { header: { epoch: "1" } });
  assert.equal(meter.isLive(61_900), true);
  assert.equal(meter.isLive(61_901), false);
});

test("nor does it where few pictures came before", () => {
  const meter = new Meter();
  for (const now of [0, 100, 60_100]) meter.add(now);
  assert.equal(meter.isLive(61_101), false);
});

test("a new epoch begins with no rate and nothing usual", () => {
  const meter = new Meter();
  for (const now of [0, 9000, 18_000]) meter.add(now, { header: { epoch: "1" } });
  assert.equal(meter.isLive(40_000), true);
  meter.add(40_000, { header: { epoch: "2" } });
  assert.equal(meter.rate(40_000), null);
  assert.equal(meter.isLive(41_001), false);
  meter.add(40_100, { header: { epoch: "2" } });
  assert.equal(meter.rate(40_100), 10);
});

test("durations have few digits and a unit", () => {
  assert.deepEqual([null, 0.4, 12.3, 1340, 42_000, 250_000, 3_900_000, 90_000_000].map(duration),
    ["–", "0 ms", "12 ms", "1.3 s", "42 s", "4 min 10 s", "1 h 05 min", "1 d 1 h"]);
});

test("rates and sizes are short", () => {
  assert.deepEqual([null, 0, 0.25, 29.97, 120.4].map(rate),
    ["–", "0.0 Hz", "0.25 Hz", "30.0 Hz", "120 Hz"]);
  assert.deepEqual([12, 3400, 34_000, 1_200_000].map(size), ["12 B", "3.4 kB", "34 kB", "1.2 MB"]);
});

test("a scale begins at 0 and ends at a round number above all values", () => {
  assert.deepEqual(axis([3, null, 29.9]), { high: 30, ticks: [0, 10, 20, 30] });
  assert.deepEqual(axis([]).ticks[0], 0);
  for (const top of [0.02, 1, 7.3, 480, 12_345]) {
    const { high, ticks } = axis([top]);
    assert.ok(high >= top && ticks.length >= 2 && ticks.length <= 6, `${top}: ${ticks}`);
  }
});
