import assert from "node:assert/strict";
import test from "node:test";

import { numberAt } from "./model/fields.js";
import { describe, rowsOf } from "./model/message_tree.js";

const plain = { toggled: new Set(), most: 100 };
const shown = (fields, options = plain) => rowsOf(fields, options).rows
  .map(({ depth, name, text }) => `${" ".repeat(depth)}${name} ${text}`);

test("a message is a tree, whose first level is open", () => {
  assert.deepEqual(shown({ header: { seq: 3 }, tracks: [{ id: 1, box: [1, 2] }], label: "a b",
    flag: true, none: null }), [
    "header {1 item}", " seq 3", "tracks [1 item]", " 0 {2 items}", 'label "a b"', "flag true",
    "none null"]);
});

test("a row is opened and closed by its key", () => {
  const fields = { a: { b: { c: 1 } } };
  const [, inner] = rowsOf(fields, plain).rows;
  assert.deepEqual(shown(fields, { ...plain, toggled: new Set([inner.key]) }),
    ["a {1 item}", " b {1 item}", "  c 1"]);
  assert.deepEqual(shown(fields, { ...plain, toggled: new Set(["a"]) }), ["a {1 item}"]);
});

test("a search shows what matches, by name or value, and what it is in", () => {
  const fields = { pose: { x: 1, y: 27 }, more: { label: "cup" }, z: 5 };
  assert.deepEqual(shown(fields, { ...plain, query: " Y" }), ["pose {2 items}", " y 27"]);
  assert.deepEqual(shown(fields, { ...plain, query: "cup" }), ["more {1 item}", ' label "cup"']);
  assert.deepEqual(shown(fields, { ...plain, query: "absent" }), []);
});

test("of ten thousand fields some are shown, and how many more there are", () => {
  const fields = Object.fromEntries(Array.from({ length: 10_000 }, (_, index) => [`f${index}`, index]));
  const { rows, left } = rowsOf(fields, plain);
  assert.equal(rows.length, 100);
  assert.equal(left, 9_900);
  assert.deepEqual(shown(fields, { ...plain, query: "f9999" }), ["f9999 9999"]);
  const deep = { list: Array.from({ length: 100_000 }, (_, index) => ({ index })) };
  const toggled = new Set(["list"]);
  const found = rowsOf(deep, { toggled, most: 50 });
  assert.equal(found.rows.length, 50);
  assert.ok(found.isCut);
});

test("a long text is cut and said to be cut", () => {
  const { rows: [row] } = rowsOf({ text: "x".repeat(1_000_000) }, plain);
  assert.ok(row.text.length < 300);
  assert.match(row.text, /… \(cut, 1000000 characters\)$/);
});

test("numbers beyond 2^53, which come as text, are numbers and keep all their digits", () => {
  const { rows: [row, , short] } = rowsOf({ big: "9007199254740993", t: "abc", n: "12" }, plain);
  assert.deepEqual([row.kind, row.text], ["number", "9007199254740993"]);
  assert.equal(short.kind, "text");
});

test("names that every object has are names like others", () => {
  const fields = JSON.parse('{"__proto__": {"polluted": 1}, "constructor": 2, "toString": "s"}');
  assert.deepEqual(shown(fields),
    ["__proto__ {1 item}", " polluted 1", "constructor 2", 'toString "s"']);
  assert.equal({}.polluted, undefined);
  assert.equal(describe({ properties: {} }, ["constructor"]), "");
  assert.equal(describe({}, ["__proto__", "x"]), "");
  assert.equal(numberAt({ header: {}, body: fields }, "toString.length"), null);
  assert.equal(numberAt({ header: {}, body: fields }, "constructor"), 2);
});

const SCHEMA = {
  $defs: { Track: { properties: { vx: { description: "pixels per second\nmore", type: "number" } } } },
  properties: {
    tracks: { type: "array", items: { $ref: "#/$defs/Track" } },
    best: { anyOf: [{ $ref: "#/$defs/Track" }, { type: "null" }], description: "the largest" },
    loop: { $ref: "#/$defs/Loop" },
  },
};

test("what a schema says of a field is found through lists, references and nil", () => {
  assert.equal(describe(SCHEMA, ["tracks", "4", "vx"]), "pixels per second");
  assert.equal(describe(SCHEMA, ["best"]), "the largest");
  assert.equal(describe(SCHEMA, ["best", "vx"]), "pixels per second");
  assert.equal(describe(SCHEMA, ["absent", "vx"]), "");
  const endless = { $defs: { A: { $ref: "#/$defs/A" } }, properties: { a: { $ref: "#/$defs/A" } } };
  assert.equal(describe(endless, ["a", "b"]), "");
});

test("a number is found by its name also beyond what a menu offers", () => {
  const body = { list: Array.from({ length: 40 }, (_, index) => ({ v: index })) };
  assert.equal(numberAt({ header: { seq: 7 }, body }, "list.39.v"), 39);
  assert.equal(numberAt({ header: { seq: 7 }, body }, "header.seq"), 7);
  assert.equal(numberAt({ header: { seq: 7 }, body }, "list.40.v"), null);
});
