import assert from "node:assert/strict";
import test from "node:test";

import { View } from "./inspector/pane_grid.js";

const FRAME = { width: 640, height: 480 };
const PANE = { width: 1280, height: 720 };

test("a whole frame fits into its pane and stands in the middle", () => {
  const view = View.fit(FRAME, PANE); // 720 / 480 = 1.5, so 960 pixels wide: 160 are left each side
  assert.equal(view.scale, 1.5);
  assert.deepEqual(view.toPane(PANE, { x: 0, y: 0 }), { x: 160, y: 0 });
  assert.deepEqual(view.toPane(PANE, { x: 640, y: 480 }), { x: 1120, y: 720 });
});

test("zooming keeps the point under the pointer", () => {
  const view = View.fit(FRAME, PANE);
  const at = { x: 400, y: 300 };
  const before = view.toFrame(PANE, at);
  const after = view.zoomed(FRAME, PANE, 3, at).toFrame(PANE, at);
  assert.ok(Math.hypot(before.x - after.x, before.y - after.y) < 1e-9);
});

test("a frame cannot be dragged out of sight", () => {
  const view = new View(2, 320, 240).panned(FRAME, 1e6, -1e6);
  assert.deepEqual({ ...view }, { scale: 2, x: 0, y: 480 });
});
