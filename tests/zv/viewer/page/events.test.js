import assert from "node:assert/strict";
import test from "node:test";

import { merged, momentOf, queryOf } from "./model/events.js";

const EVENT = { number: 1, stamp_ns: "1795736904033000000", camera: "front", kind: "started",
  track: 7 };

test("what is chosen is a query, and what is not is left out", () => {
  assert.equal(queryOf({ camera: "", kind: "", zone: "", since: "", until: "" }), "");
  const since = new Date(1_795_736_904_033);
  assert.equal(queryOf({ camera: "front", kind: "", zone: "a&b", since, until: "" }),
    "camera=front&zone=a%26b&since_ns=1795736904033000000");
});

test("events are listed once, oldest first, whatever is asked for first", () => {
  const events = [3, 2].map((number) => ({ ...EVENT, number }));
  const rows = merged(merged([], events), [4, 3, 1].map((number) => ({ ...EVENT, number })));
  assert.deepEqual(rows.map(({ number }) => number), [1, 2, 3, 4]);
  assert.equal(rows[0].at, 1_795_736_904_033);
  assert.deepEqual([rows[0].event, rows[0].id], ["started", 7]);
});

test("a picture says by how much it is not the event's", () => {
  const words = [[null, null], [5, null], [5, 0], [5, 1], [5, -3]].map(([picture, later]) =>
    momentOf({ picture, frames_later: later }));
  assert.deepEqual(words, ["no picture", "picture of another run of the camera",
    "picture of this frame", "picture 1 frame later", "picture 3 frames earlier"]);
});
