import assert from "node:assert/strict";
import test from "node:test";

const elements = new Map(); // id -> what the editor reads and writes of an element
globalThis.document = {
  activeElement: null,
  getElementById(id) {
    if (!elements.has(id)) {
      elements.set(id, Object.assign(new EventTarget(), { dataset: {}, setAttribute() {} }));
    }
    return elements.get(id);
  },
};
const { ShapeEditor } = await import("./inspector/shape_editor.js");
const { Events } = await import("./transport/connection.js");

const REACH = 9;
const MINE = "mine 50,50 150,50 150,120";

/** A tracker that accepts each change that expects its text, and an editor that is open. */
function edited(zones = "") {
  const values = new Map(Object.entries({ zones, lines: "", regions: "", ignore: "" }));
  const system = Object.assign(new Events(), { streams: [], show() {}, parameters: new Map(),
    nodes: [{ node: "tracker_front", cameras: ["front"] }] });
  const tracker = {
    values,
    refusal: "",
    /** Set a text, as the node says it to all pages. */
    set(kind, value) {
      values.set(kind, value);
      const all = [...values].map(([name, each]) => [name, { name, value: each }]);
      system.parameters.set("tracker_front", new Map(all));
      system.emit("parameters");
    },
  };
  async function request({ node, values: wanted, expected }) {
    const [[kind, value]] = Object.entries(wanted);
    assert.equal(node, "tracker_front");
    await null; // what others do meanwhile
    if (tracker.refusal) return { ok: false, error: tracker.refusal };
    if (expected[kind] !== values.get(kind)) {
      return { ok: false, error: `${kind} of ${node} was changed meanwhile` };
    }
    tracker.set(kind, value);
    return { ok: true };
  }
  const editor = new ShapeEditor(system, { request }, () => {});
  tracker.set("zones", zones);
  editor.follow("front");
  editor.toggle();
  return { editor, tracker };
}

const answered = () => new Promise(setImmediate);

async function draw(editor, kind, ...points) {
  editor.begin({ kind, points: [] });
  for (const point of points) editor.press(point, REACH);
  await answered();
}

async function move(editor, from, to) {
  editor.press(from, REACH);
  editor.drag(to);
  editor.release();
  await answered();
}

const refusal = () => document.getElementById("shape-refusal").textContent;

test("a shape of each kind ends where it began, a line at its second point, and has a name", async () => {
  const { editor, tracker } = edited();
  for (const kind of ["zones", "regions", "ignore"]) {
    await draw(editor, kind, [20, 40], [120, 40], [120, 140], [22, 41]);
  }
  await draw(editor, "lines", [200, 30], [200, 200]);
  assert.deepEqual(Object.fromEntries(tracker.values), {
    zones: "zone1 20,40 120,40 120,140", regions: "region1 20,40 120,40 120,140",
    ignore: "ignored1 20,40 120,40 120,140", lines: "line1 200,30 200,200" });
  editor.rename("gate");
  await answered();
  assert.equal(tracker.values.get("lines"), "gate 200,30 200,200");
  editor.remove();
  await answered();
  assert.equal(tracker.values.get("lines"), "");
  assert.equal(editor.chosen, null);
});

test("each change is taken back, also a wrong corner, and none of another", async () => {
  const { editor, tracker } = edited();
  const zones = () => tracker.values.get("zones");
  editor.begin({ kind: "zones", points: [] });
  for (const point of [[50, 50], [150, 50], [300, 10]]) editor.press(point, REACH);
  editor.undo();
  for (const point of [[150, 120], [50, 50]]) editor.press(point, REACH);
  await answered();
  const drawn = zones();
  assert.equal(drawn, "zone1 50,50 150,50 150,120");
  await move(editor, [150, 120], [160.4, 129.6]);
  const moved = zones();
  assert.equal(moved, "zone1 50,50 150,50 160,130");
  editor.remove();
  await answered();
  assert.equal(zones(), "");
  for (const before of [moved, drawn]) {
    editor.undo();
    await answered();
    assert.equal(zones(), before);
  }
  tracker.set("zones", "theirs 10,10 90,10 90,90");
  editor.undo();
  await answered();
  assert.equal(refusal(), "zones was changed by another meanwhile");
  assert.equal(zones(), "theirs 10,10 90,10 90,90");
  assert.equal(document.getElementById("shape-undo").disabled, true);
});

test("of two who move a corner at once the later is told, overwrites nothing, and can try again", async () => {
  const { editor, tracker } = edited(MINE);
  const both = `${MINE}; theirs 200,10 300,10 300,90`;
  editor.press([150, 120], REACH);
  editor.drag([160, 125]);
  tracker.set("zones", both);
  editor.release();
  await answered();
  assert.equal(refusal(), "zones of tracker_front was changed meanwhile");
  assert.equal(tracker.values.get("zones"), both);
  assert.deepEqual(editor.zones.map(({ name }) => name), ["mine", "theirs"]);
  await move(editor, [150, 120], [170, 130]);
  assert.equal(tracker.values.get("zones"), both.replace("150,120", "170,130"));
  assert.equal(refusal(), "");
});

test("what the tracker refuses is told by its reason alone, and its shapes are drawn again", async () => {
  const { editor, tracker } = edited(MINE);
  const reason = "'mine': the edge from point 1 to 2 crosses or touches the edge from point 3 to 4";
  tracker.refusal = `zones = '${MINE}' is not allowed (${reason})`;
  await move(editor, [150, 120], [60, 10]);
  assert.equal(refusal(), reason);
  assert.deepEqual(editor.zones[0].points[2], [150, 120]);
  tracker.refusal = "";
  await move(editor, [150, 120], [150, 110]);
  assert.equal(tracker.values.get("zones"), "mine 50,50 150,50 150,110");
});

test("a corner is moved by pixels, an edge moves its shape, and what has no choice moves nothing", async () => {
  const { editor, tracker } = edited(MINE);
  assert.equal(editor.nudge([1, 0]), false);
  editor.press([150, 120], REACH);
  editor.release();
  for (const by of [[1, 0], [1, 0], [0, 1], [-10, 0]]) assert.equal(editor.nudge(by), true);
  await answered();
  assert.equal(tracker.values.get("zones"), "mine 50,50 150,50 142,121");
  editor.press([100, 50], REACH);
  editor.nudge([0, -1]);
  await answered();
  assert.equal(tracker.values.get("zones"), "mine 50,49 150,49 142,120");
});

test("a change by another is shown; Escape gives up what is begun, then ends the editing", async () => {
  const { editor, tracker } = edited();
  tracker.set("lines", "gate 200,30 200,200; far world 0,0 1,1");
  assert.deepEqual(editor.marks().lines.map(({ name }) => name), ["gate", "far"]);
  editor.begin({ kind: "lines", points: [] });
  editor.press([50, 50], REACH);
  assert.equal(editor.escape(), true);
  assert.deepEqual([editor.draft, editor.isActive], [null, true]);
  assert.equal(editor.press([60, 20], REACH), false);
  assert.equal(editor.escape(), true);
  assert.deepEqual([editor.isActive, editor.escape()], [false, false]);
  assert.equal(tracker.values.get("lines"), "gate 200,30 200,200; far world 0,0 1,1");
});
