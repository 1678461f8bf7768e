import assert from "node:assert/strict";
import test from "node:test";

import { distanceToEdge, freeName, readShapes, shapeAt, writeShapes } from "./model/shapes.js";
import { shapeLabel } from "./video/shape_marks.js";

test("shapes are read as the tracker writes them in TOML, and written in short", () => {
  const text = "belt 10 , 10  200,10 200,1e2; pick world 0,0 0.4,0 .4,-.2\n# none 1,1\ndoor 1,2 3,4 5,0";
  const shapes = readShapes(text);
  assert.deepEqual(shapes, [
    { name: "belt", world: false, points: [[10, 10], [200, 10], [200, 100]] },
    { name: "pick", world: true, points: [[0, 0], [0.4, 0], [0.4, -0.2]] },
    { name: "door", world: false, points: [[1, 2], [3, 4], [5, 0]] },
  ]);
  assert.equal(writeShapes(shapes),
    "belt 10,10 200,10 200,100; pick world 0,0 0.4,0 0.4,-0.2; door 1,2 3,4 5,0");
  assert.deepEqual(readShapes(writeShapes(shapes)), shapes);
  assert.deepEqual(readShapes(" ;\n# nothing\n"), []);
  assert.deepEqual(readShapes("a; b 1,1; c x,1 2,2; d 1,1 nan,2; world; 1,1 2,2"), []);
});

test("a new shape gets the first free name", () => {
  assert.equal(freeName("zones", []), "zone1");
  assert.equal(freeName("zones", [{ name: "zone1" }, { name: "belt" }, { name: "zone3" }]), "zone2");
});

test("the distance to an edge is that to its nearest point", () => {
  assert.equal(distanceToEdge([5, 3], [0, 0], [10, 0]), 3);
  assert.equal(distanceToEdge([-3, 4], [0, 0], [10, 0]), 5);
  assert.equal(distanceToEdge([3, 4], [0, 0], [0, 0]), 5);
});

const SHAPES = {
  zones: [{ name: "a", world: false, points: [[0, 0], [100, 0], [100, 100]] },
    { name: "w", world: true, points: [[50, 0], [51, 0], [51, 1]] }],
  lines: [{ name: "g", world: false, points: [[104, 0], [200, 0]] }],
  regions: [], ignore: [],
};

test("a corner is found before an edge, the nearest first, and nothing that is too far", () => {
  assert.deepEqual(shapeAt(SHAPES, [101, 1], 9), { kind: "zones", index: 0, corner: 1 });
  assert.deepEqual(shapeAt(SHAPES, [103, 0], 9), { kind: "lines", index: 0, corner: 0 });
  assert.deepEqual(shapeAt(SHAPES, [50, 4], 9), { kind: "zones", index: 0, corner: null });
  // The edge from the last corner to the first.
  assert.deepEqual(shapeAt(SHAPES, [50, 53], 9), { kind: "zones", index: 0, corner: null });
  assert.equal(shapeAt(SHAPES, [20, 80], 9), null);
});

test("a label has the count, if a message has one", () => {
  assert.equal(shapeLabel({ name: "belt" }, { entered: 7, left: 5, inside: 2 }), "belt: 2 in");
  for (const count of [undefined, null, {}, 5, "x", { inside: "2" }, { left: null, right: 5 }]) {
    assert.equal(shapeLabel({ name: "gate" }, count, { x: 1, y: 0 }), "gate");
  }
});

test("the arrows of a line's counts point where its sides are on the canvas", () => {
  const label = (x, y) => shapeLabel({ name: "gate" }, { left: 3, right: 5 }, { x, y });
  assert.equal(label(1, 0), "gate: 5 →  3 ←");
  assert.equal(label(-1, 0), "gate: 5 ←  3 →");
  assert.equal(label(-1, -0), "gate: 5 ←  3 →");
  assert.equal(label(0, 1), "gate: 5 ↓  3 ↑");
  assert.equal(label(0, -1), "gate: 5 ↑  3 ↓");
  assert.equal(label(0.7, 0.7), "gate: 5 ↘  3 ↖");
  assert.equal(label(0.95, 0.3), "gate: 5 →  3 ←");
});
