// One picture of the large view: its canvas, the overlay's canvas above it, and what it says.

import { element, mark, say } from "./elements.js";
import { topicName } from "./naming.js";
import { drawOverlay } from "./overlay.js";
import { release } from "./frames.js";
import { toFrame, toPane } from "./viewport.js";

const PIXELS_FROM_SCALE = 2; // from here on, pixels are seen as squares

export class Pane {
  constructor(stream) {
    this.key = stream.key;
    this.seq = null;
    this._item = null;
    this._probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    this._picture = element("canvas", { class: "picture", "data-key": this.key,
      "data-live": "false", role: "img", "aria-label": `${stream.camera} ${topicName(stream)}` });
    this._overlay = element("canvas", { class: "overlay", "aria-hidden": "true" });
    this._state = element("p", { class: "pane-state", role: "status" });
    this._badge = element("p", { class: "pane-badge" }, element("i", { class: "lamp" }),
      element("span"));
    this._value = element("output", { class: "pane-value" });
    this._behind = element("span", { class: "pane-behind" });
    this.badge("", false);
    this.surface = element("div", { class: "pane-surface" }, this._picture, this._overlay,
      this._badge, this._state);
    this.element = element("figure", { class: "pane", "data-key": this.key }, this.surface,
      element("figcaption", {}, element("b", {}, topicName(stream)), this._behind, this._value));
  }

  /** Size in device pixels. */
  get size() {
    return { width: this._picture.width, height: this._picture.height };
  }

  /** Make the canvases as large as the pane is. Returns whether that changed anything. */
  fitToSurface() {
    const ratio = devicePixelRatio || 1;
    const width = Math.max(1, Math.round(this.surface.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.surface.clientHeight * ratio));
    if (this._picture.width === width && this._picture.height === height) return false;
    for (const canvas of [this._picture, this._overlay]) Object.assign(canvas, { width, height });
    return true;
  }

  /** Take over this pane's picture of a frame; without one, the one before stays, marked. */
  take(frame) {
    const item = frame.items.get(this.key);
    if (item?.bitmap) {
      if (this._item !== item) release(this._item);
      this._item = item;
      this.seq = frame.seq;
    }
    const isBehind = this.seq !== frame.seq;
    mark(this.element, "step", !isBehind);
    say(this._behind, isBehind && this.seq !== null ? `frame ${this.seq}, not ${frame.seq}` : "");
  }

  /** Draw picture and overlay of the same frame. `overlay` is {keys, trails}. */
  paint(frame, view, overlay, pointer) {
    const { width, height } = this.size;
    const ratio = devicePixelRatio || 1;
    const picture = this._picture.getContext("2d", { alpha: false });
    const marks = this._overlay.getContext("2d");
    picture.fillStyle = "#000";
    picture.fillRect(0, 0, width, height);
    marks.clearRect(0, 0, width, height);
    if (!this._item) return;
    const { header } = frame;
    const corner = toPane(view, this.size, { x: 0, y: 0 });
    picture.imageSmoothingEnabled = view.scale < PIXELS_FROM_SCALE;
    picture.drawImage(this._item.bitmap, corner.x, corner.y, header.width * view.scale,
      header.height * view.scale);
    const isSame = this.seq === frame.seq;
    const drawn = isSame
      ? drawOverlay(marks, frame, overlay.keys, overlay.trails, view, this.size, ratio) : [];
    if (pointer) this._cross(marks, toPane(view, this.size, pointer), ratio);
    this._tell(frame, view, overlay, drawn);
    this._point(pointer, header);
  }

  /** Say the value under a point of the frame, or nothing. */
  _point(pointer, header) {
    this.value = pointer ? this._valueAt(pointer, header) : "";
    say(this._value, this.value);
  }

  /** The frame's point at a point of the surface, or null outside of the frame. */
  locate(view, at, header) {
    const { x, y } = toFrame(view, this.size, at);
    const inside = x >= 0 && y >= 0 && x < header.width && y < header.height;
    return inside ? { x: Math.floor(x) + 0.5, y: Math.floor(y) + 0.5 } : null;
  }

  /** Say how the pane stands: live or not, with words if not. */
  judge(live, words) {
    mark(this._picture, "live", live);
    mark(this.element, "live", live);
    say(this._state, words);
    this._state.hidden = !words;
  }

  /** Say how many of the last frames had their messages; an empty text hides it. */
  badge(words, isWithout) {
    say(this._badge.lastElementChild, words);
    this._badge.hidden = !words;
    mark(this._badge, "without", isWithout);
  }

  close() {
    release(this._item);
    this._item = null;
    this.element.remove();
  }

  _tell(frame, view, overlay, drawn) {
    const found = overlay.keys.filter((key) => frame.items.has(key)).length;
    const joined = !overlay.keys.length ? "off"
      : found === overlay.keys.length ? "joined" : found ? "partial" : "without";
    mark(this._picture, "epoch", frame.epoch);
    mark(this._picture, "seq", this.seq);
    mark(this._picture, "overlay", joined);
    mark(this._overlay, "seq", frame.seq);
    mark(this._overlay, "boxes", JSON.stringify(drawn));
    mark(this._overlay, "view", `${view.scale} ${view.x} ${view.y}`);
  }

  _valueAt({ x, y }, header) {
    const { bitmap } = this._item;
    const column = Math.floor((x * bitmap.width) / header.width);
    const row = Math.floor((y * bitmap.height) / header.height);
    this._probe.clearRect(0, 0, 1, 1);
    this._probe.drawImage(bitmap, -column, -row);
    const [red, green, blue] = this._probe.getImageData(0, 0, 1, 1).data;
    return red === green && green === blue ? `${red}` : `R ${red}  G ${green}  B ${blue}`;
  }

  _cross(context, { x, y }, ratio) {
    context.strokeStyle = "rgba(255, 255, 255, 0.8)";
    context.lineWidth = ratio;
    context.globalCompositeOperation = "difference";
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + 4 * ratio * dx, y + 4 * ratio * dy);
      context.lineTo(x + 12 * ratio * dx, y + 12 * ratio * dy);
    }
    context.stroke();
    context.globalCompositeOperation = "source-over";
  }
}
