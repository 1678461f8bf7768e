import assert from "node:assert/strict";
import test from "node:test";

import { FrameJoiner } from "./video/frame_joiner.js";
import { Playback } from "./video/playback.js";

const CAMERA = "vision/front/image/compressed";
const MASK = "vision/front/mask/compressed";
const CENTROID = "vision/front/centroid";
const FRAME_MS = 33;

/** The header of frame `seq`, captured 33 ms after the one before. */
function header(seq, epoch = "1") {
  return { epoch, seq, stamp_ns: String(1_000_000_000n + BigInt(seq * FRAME_MS) * 1_000_000n) };
}

/** A joiner that has seen enough frames to know how long one lasts; the next is frame 10. */
function practised(pictures = [CAMERA], messages = [CENTROID]) {
  const dropped = [];
  const joiner = new FrameJoiner(pictures, messages, (item) => dropped.push(item), 0);
  for (let seq = 0; seq < 10; seq += 1) {
    for (const key of [...pictures, ...messages]) joiner.offer(key, header(seq), `${key} ${seq}`, 0);
    assert.equal(joiner.take(0).seq, seq);
  }
  assert.equal(joiner.frameTime, FRAME_MS);
  return { joiner, dropped };
}

test("a picture is released with the message of its own frame", () => {
  const { joiner } = practised();
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  assert.equal(joiner.take(100), null);
  joiner.offer(CENTROID, header(10), "centroid 10", 120);
  const frame = joiner.take(120);
  assert.equal(frame.seq, 10);
  assert.equal(frame.items.get(CENTROID), "centroid 10");
  assert.deepEqual(frame.missing, []);
});

test("a message that comes before its picture is kept for it", () => {
  const { joiner } = practised();
  joiner.offer(CENTROID, header(10), "centroid 10", 90);
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  assert.equal(joiner.take(100).items.get(CENTROID), "centroid 10");
});

test("a picture waits two frame times and is then released without its message", () => {
  const { joiner } = practised();
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  assert.equal(joiner.due(), 100 + 2 * FRAME_MS);
  assert.equal(joiner.take(100 + 2 * FRAME_MS - 1), null);
  assert.deepEqual(joiner.take(100 + 2 * FRAME_MS).missing, [CENTROID]);
});

test("a message that comes too late is drawn on no other frame", () => {
  const { joiner, dropped } = practised();
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.take(200);
  joiner.offer(CENTROID, header(10), "centroid 10", 201);
  joiner.offer(CAMERA, header(11), "picture 11", 202);
  assert.equal(joiner.take(202), null);
  assert.ok(dropped.includes("centroid 10"));
  assert.equal(joiner.lag(CENTROID), 101);
});

test("a picture does not wait for a message that was left out", () => {
  // A tracker at a third of the camera's rate: the message of 12 says that 10 and 11 have none.
  const { joiner, dropped } = practised();
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.offer(CENTROID, header(12), "centroid 12", 101);
  assert.deepEqual(joiner.take(101).missing, [CENTROID]);
  joiner.offer(CAMERA, header(11), "picture 11", 133);
  assert.equal(joiner.take(133).seq, 11);
  joiner.offer(CAMERA, header(12), "picture 12", 166);
  assert.equal(joiner.take(166).items.get(CENTROID), "centroid 12");
  assert.deepEqual(dropped, []);
});

test("a complete frame goes before older ones that wait, and those are dropped", () => {
  const { joiner, dropped } = practised();
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.offer(CAMERA, header(11), "picture 11", 133);
  joiner.offer(CENTROID, header(11), "centroid 11", 140);
  assert.equal(joiner.take(140).seq, 11);
  assert.deepEqual(dropped, ["picture 10"]);
  assert.equal(joiner.take(500), null);
});

test("a picture does not wait for a stream that has been silent for a second", () => {
  const { joiner } = practised();
  joiner.offer(CAMERA, header(40), "picture 40", 1001);
  assert.deepEqual(joiner.take(1001).missing, [CENTROID]);
});

test("pictures of several streams are released together", () => {
  const { joiner } = practised([CAMERA, MASK], []);
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.offer(MASK, header(9), "mask 9", 110);
  assert.equal(joiner.take(110), null);
  joiner.offer(MASK, header(10), "mask 10", 120);
  assert.deepEqual([...joiner.take(120).items.values()], ["picture 10", "mask 10"]);
});

test("a picture waits longer for those that stand beside it", () => {
  const { joiner } = practised([CAMERA, MASK], []);
  joiner.offer(MASK, header(9), "mask 9", 600); // it is not silent
  joiner.offer(CAMERA, header(10), "picture 10", 700);
  assert.equal(joiner.take(700 + 11 * FRAME_MS), null);
  assert.deepEqual(joiner.take(700 + 12 * FRAME_MS).missing, [MASK]);
});

test("while whole frames come, a frame without one of its pictures is not shown", () => {
  // A mask at a third of the camera's rate: the one of 12 says that 10 and 11 have none.
  const { joiner, dropped } = practised([CAMERA, MASK], []);
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.offer(CAMERA, header(11), "picture 11", 133);
  joiner.offer(MASK, header(12), "mask 12", 140);
  assert.equal(joiner.take(140), null);
  assert.deepEqual(dropped, ["picture 10", "picture 11"]);
  joiner.offer(CAMERA, header(12), "picture 12", 166);
  assert.deepEqual([...joiner.take(166).items.values()], ["mask 12", "picture 12"]);
});

test("after a second without a whole frame, pictures are shown without those beside them", () => {
  const { joiner } = practised([CAMERA, MASK], []);
  joiner.offer(CAMERA, header(10), "picture 10", 998);
  joiner.offer(MASK, header(11), "mask 11", 999);
  assert.equal(joiner.take(999), null);
  joiner.offer(CAMERA, header(12), "picture 12", 1000);
  joiner.offer(MASK, header(13), "mask 13", 1000);
  assert.deepEqual(joiner.take(1000).missing, [MASK]);
});

test("a new epoch begins with its first picture, whatever its numbers", () => {
  const { joiner } = practised();
  joiner.offer(CENTROID, header(0, "2"), "new centroid 0", 100);
  joiner.offer(CAMERA, header(0, "2"), "new picture 0", 101);
  const frame = joiner.take(101);
  assert.equal(frame.epoch, "2");
  assert.equal(frame.items.get(CENTROID), "new centroid 0");
});

test("after a picture with a wrong number the others are shown on", () => {
  const { joiner } = practised();
  joiner.offer(CAMERA, header(900), "picture 900", 100);
  assert.equal(joiner.take(100 + 2 * FRAME_MS).seq, 900);
  joiner.offer(CENTROID, header(11), "centroid 11", 2000); // a message alone begins nothing anew
  assert.equal(joiner.take(2000), null);
  joiner.offer(CAMERA, header(12), "picture 12", 2033);
  joiner.offer(CENTROID, header(12), "centroid 12", 2034);
  assert.equal(joiner.take(2034).items.get(CENTROID), "centroid 12");
  joiner.offer(CAMERA, header(13), "picture 13", 2066);
  joiner.offer(CENTROID, header(13), "centroid 13", 2066);
  assert.equal(joiner.take(2066).seq, 13);
});

test("messages of another epoch are not joined though the number is the same", () => {
  const { joiner } = practised();
  joiner.offer(CENTROID, header(10, "0"), "old centroid 10", 100);
  joiner.offer(CAMERA, header(10), "picture 10", 101);
  assert.equal(joiner.take(101), null);
});

test("with only complete frames wanted, one waits longer and is never shown without", () => {
  const { joiner, dropped } = practised();
  joiner.onlyComplete = true;
  joiner.offer(CAMERA, header(10), "picture 10", 100);
  joiner.offer(CENTROID, header(10), "centroid 10", 100 + 5 * FRAME_MS);
  assert.equal(joiner.take(100 + 5 * FRAME_MS).seq, 10);
  joiner.offer(CAMERA, header(11), "picture 11", 300);
  assert.equal(joiner.take(2000), null);
  assert.ok(dropped.includes("picture 11"));
});

test("what is waiting stays bounded when only messages come", () => {
  const { joiner, dropped } = practised();
  for (let seq = 10; seq < 1010; seq += 1) joiner.offer(CENTROID, header(seq), seq, 100);
  assert.ok(dropped.length >= 1000 - 128);
});

test("pictures that can never be of one frame with the leading ones are named after a while", () => {
  const { joiner, dropped } = practised([CAMERA, MASK], []);
  for (let at = 100; at <= 3000; at += FRAME_MS) {
    const seq = 10 + Math.round((at - 100) / FRAME_MS);
    joiner.offer(CAMERA, header(seq), `picture ${seq}`, at);
    joiner.offer(MASK, header(seq, "of its own"), `mask ${seq}`, at);
    joiner.take(at);
    assert.deepEqual(joiner.strangers(at), at - 100 > 2000 ? [MASK] : []);
    const held = seq - 9 - dropped.filter((one) => one.startsWith("mask")).length;
    assert.ok(held <= 16, `${held} pictures wait`);
  }
  joiner.offer(CAMERA, header(0, "of its own"), "picture", 3100); // the camera has begun anew
  assert.deepEqual(joiner.strangers(9000), []);
});

test("what was held while paused is stepped through, and of others what is nearest in time", async () => {
  const shown = [];
  const playback = new Playback((frame) => shown.push(frame.seq));
  const at = (ms) => ({ stamp_ns: `1795744970${ms}000000` });
  const frame = (seq, ms) => ({ seq, header: at(ms), items: new Map() });
  for (const seq of [1, 2, 3]) playback.add(frame(seq, 100 * seq));
  playback.setPaused(true);
  playback.add(frame(4, 400));
  assert.deepEqual([shown.splice(0), playback.header, playback.isAtEnd], [[1, 2, 3], at(300), true]);
  await playback.step(-1);
  await playback.step(-1);
  await playback.step(-1);
  assert.deepEqual([shown.splice(0), playback.header, playback.isAtEnd], [[2, 1], at(100), false]);
  await playback.showNearest(at(249));
  await playback.showNearest(at(251));
  await playback.showNearest(at(999)); // which is shown already
  playback.wantsOne = true;
  for (const seq of [5, 6]) playback.add(frame(seq, 100 * seq));
  assert.deepEqual([shown, playback.header], [[2, 3, 5], at(500)]);
});
