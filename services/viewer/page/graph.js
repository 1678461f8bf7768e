// The panel with the graph of nodes and keys, as SVG.

import { byId, element, mark, say, svg } from "./elements.js";
import { layOut, ROW } from "./layering.js";

const WIDTH = 620;
const NODE_WIDTH = 132;
const KEY_LEFT = 168;
const KEY_RIGHT = 424;
const RIGHT = WIDTH - NODE_WIDTH - 2;

export class GraphPanel {
  constructor(system, camera) {
    this._system = system;
    this._camera = camera;
    this._visible = false;
    this._choice = byId("graph-camera");
    this._choice.addEventListener("change", () => this._draw());
    system.on("nodes", () => this._draw());
    system.on("streams", () => this._draw());
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
    const state = JSON.stringify([camera, nodes.map((node) => [node.node, node.alive,
      node.publishes, node.subscribes])]);
    if (state === this._state) return;
    this._state = state;
    this._prefix = camera ? `${this._system.hello?.namespace ?? ""}/${camera}/` : "";
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
    const drawing = svg("svg", { viewBox: `0 -2 ${WIDTH} ${height + 4}`, width: WIDTH,
      height: height + 4, role: "img", "aria-label": "Graph of nodes and keys",
      class: "graph-drawing" });
    const senderAt = new Map(senders.map((one) => [one.node, one]));
    const receiverAt = new Map(receivers.map((one) => [one.node, one]));
    for (const row of rows) drawing.append(...this._lines(row, senderAt, receiverAt));
    for (const row of rows) drawing.append(this._key(row));
    for (const one of senders) drawing.append(this._node(one, 1, alive.get(one.node)));
    for (const one of receivers) drawing.append(this._node(one, RIGHT, alive.get(one.node)));
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
      const bend = (KEY_RIGHT + RIGHT) / 2;
      made.push(svg("path", { class: "wire", "data-nodes": name,
        d: `M${KEY_RIGHT} ${middle} C${bend} ${middle} ${bend} ${to} ${RIGHT - 6} ${to}` }),
      svg("path", { class: "head", d: `M${RIGHT - 7} ${to - 3.5} L${RIGHT} ${to} L${RIGHT - 7} ${
        to + 3.5} Z` }));
    }
    return made;
  }

  _key({ key, y, receivers, sender }) {
    const isPicture = this._system.stream(key)?.kind === "picture";
    const short = key.startsWith(this._prefix) ? key.slice(this._prefix.length) : key;
    const label = svg("text", { x: KEY_LEFT + 8, y: y + ROW / 2 + 4 }, short);
    const kind = `key ${receivers.length ? "" : "unheard"} ${sender ? "" : "unsent"}`;
    const box = svg("rect", { x: KEY_LEFT, y: y + 2, width: KEY_RIGHT - KEY_LEFT, height: ROW - 4 });
    const words = svg("title", {}, `${key}${receivers.length ? "" : " – nobody subscribes"}`);
    if (!isPicture) return svg("g", { class: kind }, words, box, label);
    return svg("a", { class: `${kind} picture`, href: `#${key}`, "aria-label": `Show ${key}` },
      words, box, label);
  }

  _node({ node, y, height }, x, isAlive) {
    const text = svg("text", { x: x + 8, y: y + Math.min(height, ROW) / 2 + 4 },
      node.length > 17 ? `${node.slice(0, 16)}…` : node);
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
