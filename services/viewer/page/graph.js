// The panel with the graph of nodes and keys, as SVG.

import { byId, element, mark, say, svg } from "./elements.js";
import { layOut, ROW } from "./layering.js";
import { topicName } from "./naming.js";

const NODE_WIDTH = 106;
const KEY_LEFT = NODE_WIDTH + 14;
const CURVE_WIDTH = 34;
const NARROWEST = 356;
const WIDEST = 600;
const LONGEST_NAME = 15;

export class GraphPanel {
  constructor(system, camera) {
    this._system = system;
    this._camera = camera;
    this._visible = false;
    this._choice = byId("graph-camera");
    this._choice.addEventListener("change", () => this._draw());
    system.on("nodes", () => this._draw());
    system.on("streams", () => this._draw());
    new ResizeObserver(() => this._draw()).observe(byId("graph"));
  }

  show(visible) {
    this._visible = visible;
    this._draw();
  }

  arrange() {
    if (this._camera() && this._choice.value !== "") this._choice.value = this._camera();
    this._draw();
  }

  _draw() {
    if (!this._visible) return;
    this._offerCameras();
    const camera = this._choice.value;
    const nodes = this._system.nodes
      .filter((node) => !camera || !node.cameras?.length || node.cameras.includes(camera))
      .map((node) => ({ ...node, publishes: this._of(camera, node.publishes),
        subscribes: this._of(camera, node.subscribes) }));
    const width = byId("graph").clientWidth - 28;
    this._width = Math.min(WIDEST, Math.max(NARROWEST, width));
    this._right = this._width - NODE_WIDTH - 1;
    this._keyRight = this._right - CURVE_WIDTH;
    const state = JSON.stringify([camera, this._width, nodes.map((node) => [node.node, node.alive,
      node.publishes, node.subscribes])]);
    if (state === this._state) return;
    this._state = state;
    const laid = layOut(nodes);
    byId("graph").replaceChildren(laid.rows.length ? this._drawing(laid, nodes)
      : element("p", { class: "empty" }, "No node publishes or subscribes yet."));
    const lonely = nodes.filter((node) => !node.publishes.length && !node.subscribes.length);
    say(byId("graph-lonely"), lonely.length
      ? `Neither publish nor subscribe here: ${lonely.map((node) => node.node).join(", ")}.` : "");
  }

  _of(camera, keys) {
    const start = `${this._system.hello?.namespace ?? ""}/${camera}/`;
    return (keys ?? []).filter((key) => !camera || key.startsWith(start) || key.includes("*"));
  }

  _offerCameras() {
    const cameras = this._system.cameras;
    const wanted = [...cameras, ""];
    if ([...this._choice.options].map((option) => option.value).join() === wanted.join()) return;
    const before = this._choice.options.length ? this._choice.value : this._camera();
    this._choice.replaceChildren(...wanted.map((camera) =>
      element("option", { value: camera }, camera || "all cameras")));
    this._choice.value = wanted.includes(before) ? before : wanted[0];
  }

  _drawing({ rows, senders, receivers, height }, nodes) {
    const alive = new Map(nodes.map((node) => [node.node, node.alive !== false]));
    const drawing = svg("svg", { viewBox: `0 -2 ${this._width} ${height + 4}`, width: this._width,
      height: height + 4, role: "img", "aria-label": "Graph of nodes and keys",
      class: "graph-drawing" });
    const senderAt = new Map(senders.map((one) => [one.node, one]));
    const receiverAt = new Map(receivers.map((one) => [one.node, one]));
    for (const row of rows) drawing.append(...this._lines(row, senderAt, receiverAt));
    for (const row of rows) drawing.append(this._key(row));
    for (const one of senders) drawing.append(this._node(one, 1, alive.get(one.node)));
    for (const one of receivers) drawing.append(this._node(one, this._right, alive.get(one.node)));
    for (const name of alive.keys()) this._highlight(drawing, name);
    return drawing;
  }

  _lines(row, senderAt, receiverAt) {
    const middle = row.y + ROW / 2;
    const made = [];
    if (senderAt.has(row.sender)) {
      made.push(svg("path", { class: "wire", "data-nodes": row.sender,
        d: `M${NODE_WIDTH + 1} ${middle} H${KEY_LEFT}` }));
    }
    for (const name of row.receivers) {
      const to = receiverAt.get(name).y + ROW / 2;
      const [from, end] = [this._keyRight, this._right];
      const bend = (from + end) / 2;
      made.push(svg("path", { class: "wire", "data-nodes": name,
        d: `M${from} ${middle} C${bend} ${middle} ${bend} ${to} ${end - 6} ${to}` }),
      svg("path", { class: "head", d: `M${end - 7} ${to - 3.5} L${end} ${to} l-7 3.5 Z` }));
    }
    return made;
  }

  _key({ key, y, receivers, sender }) {
    const stream = this._system.stream(key);
    const isPicture = stream?.kind === "picture";
    const name = stream ? topicName(stream) : key;
    const label = svg("text", { x: KEY_LEFT + 5, y: y + ROW / 2 + 4 },
      stream && !this._choice.value ? `${stream.camera}/${name}` : name);
    const kind = `key ${receivers.length ? "" : "unheard"} ${sender ? "" : "unsent"}`;
    const box = svg("rect", { x: KEY_LEFT, y: y + 2, width: this._keyRight - KEY_LEFT,
      height: ROW - 4 });
    const words = svg("title", {}, `${key}${receivers.length ? "" : " – nobody subscribes"}`);
    if (!isPicture) return svg("g", { class: kind }, words, box, label);
    return svg("a", { class: `${kind} picture`, href: `#${key}`, "aria-label": `Show ${key}` },
      words, box, label);
  }

  _node({ node, y, height }, x, isAlive) {
    const text = svg("text", { x: x + 8, y: y + Math.min(height, ROW) / 2 + 4 },
      node.length > LONGEST_NAME ? `${node.slice(0, LONGEST_NAME - 1)}…` : node);
    return svg("g", { class: isAlive ? "node" : "node gone", "data-node": node },
      svg("title", {}, `${node}${isAlive ? "" : " – gone"}`),
      svg("rect", { x, y: y + 1, width: NODE_WIDTH, height: height - 2 }), text);
  }

  /** Under the pointer, a node shows its own lines. */
  _highlight(drawing, name) {
    for (const box of drawing.querySelectorAll(`[data-node="${CSS.escape(name)}"]`)) {
      const light = (on) => {
        for (const wire of drawing.querySelectorAll(`.wire[data-nodes="${CSS.escape(name)}"]`)) {
          mark(wire, "on", on);
        }
      };
      box.addEventListener("pointerenter", () => light(true));
      box.addEventListener("pointerleave", () => light(false));
    }
  }
}
