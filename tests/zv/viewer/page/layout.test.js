import assert from "node:assert/strict";
import test from "node:test";

import { PLAIN, readLayout, writeLayout } from "./model/layout.js";
import { Transfer, watchOptions } from "./model/transfer.js";

const IMAGE = "vision/front/image/compressed";
const MASK = "vision/front/mask/compressed";

test("the keys of the fragment are the streams that are shown large, each once", () => {
  const { layout, refused } = readLayout(`${IMAGE}+${MASK}+${IMAGE}`);
  assert.deepEqual(layout, { ...PLAIN, keys: [IMAGE, MASK] });
  assert.deepEqual(refused, []);
  assert.deepEqual(readLayout("").layout, PLAIN);
});

test("a layout is read as it was written", () => {
  const layout = { keys: [IMAGE], only: [MASK, IMAGE], columns: 2, width: 320, quality: 40,
    panel: "plots", hide: ["top", "captions"] };
  const text = `${IMAGE}?only=${MASK}+${IMAGE}&columns=2&width=320&quality=40&panel=plots`
    + "&hide=top+captions";
  assert.equal(writeLayout(layout), text);
  assert.deepEqual(readLayout(text), { layout, refused: [] });
  assert.equal(writeLayout(PLAIN), "");
});

test("what is not allowed is left out and named, and the rest counts", () => {
  for (const [text, said] of [
    ["columns=99", "columns = 99 is not allowed; allowed: 1 to 8"],
    ["columns=1e3", "columns = 1e3 is not allowed; allowed: 1 to 8"],
    ["width=-3", "width = -3 is not allowed; allowed: 1 to 7680"],
    ["quality=", "quality =  is not allowed; allowed: 1 to 100"],
    ["panel=__proto__", "panel = __proto__ is not allowed; allowed: parameters, plots, graph, message, "
      + "events, health, log, none"],
    ["hide=all", "hide = all is not allowed; allowed: top, bars, captions"],
    ["only=<script>", "only = <script> is not a key; allowed: such as vision/front/image/compressed"],
    ["constructor=1", "constructor is unknown; allowed: only, columns, width, quality, panel, hide"],
    [`${"x".repeat(500)}=1`, `${"x".repeat(40)}… is unknown; allowed: only, columns, width, `
      + "quality, panel, hide"],
  ]) {
    const { layout, refused } = readLayout(`${IMAGE}?${text}&columns=3`);
    assert.deepEqual(refused, [said]);
    assert.deepEqual(layout, { ...PLAIN, keys: [IMAGE], columns: 3 });
  }
});

test("a fragment that is no key shows the wall", () => {
  for (const text of ["front", "a/b", "a//b/c", "vision/front/**", "/a/b/c", "a/b/c d"]) {
    const { layout, refused } = readLayout(text);
    assert.deepEqual([layout.keys, refused.length], [[], 1]);
  }
  const many = Array.from({ length: 40 }, (_, index) => `v/c${index}/image`);
  const { layout, refused } = readLayout(`?only=${many.join("+")}`);
  assert.deepEqual([layout.only.length, refused], [30, ["only has 40 keys; allowed: 30"]]);
});

test("a stream has its own size, else that of all, and the one in the URL counts before both", () => {
  const transfer = new Transfer();
  assert.deepEqual(watchOptions(transfer.of(IMAGE)), {});
  transfer.setCommon({ width: 640, quality: null });
  transfer.streams.set(MASK, { width: 160, quality: 20 });
  assert.deepEqual([IMAGE, MASK].map((key) => watchOptions(transfer.of(key))),
    [{ width: 640 }, { width: 160, quality: 20 }]);
  transfer.fix({ width: null, quality: 60 });
  assert.deepEqual(watchOptions(transfer.of(MASK)), { quality: 60 });
  transfer.fix({ width: null, quality: null });
  transfer.streams.set(MASK, null);
  assert.deepEqual(watchOptions(transfer.of(MASK)), { width: 640 });
});
