// One stream on the wall: a small moving picture that never looks live when it is not.

import { NewestDecoder } from "./decoding.js";
import { element, mark, say } from "./elements.js";
import { clock, duration, rate } from "./format.js";
import { Meter } from "./meter.js";
import { streamName, topicName } from "./naming.js";

const WIDTHS = [160, 240, 320, 480, 640];
const QUALITY = 70;

export class Tile {
  /**
   * @param stream its row of the server's list
   * @param watches the page's Watches
   * @param pace returns the least time between two pictures of a tile, ms
   * @param serverNow returns the time by the server's clock, ms since 1970
   */
  constructor(stream, watches, pace, serverNow) {
    this.key = stream.key;
    this._watches = watches;
    this._pace = pace;
    this._serverNow = serverNow;
    this._stop = null;
    this._ended = null;
    this._width = null;
    this._forget();
    this._build(stream);
    this.update(stream);
  }

  /** Take what the server says of this stream now. */
  update(stream) {
    this.stream = stream;
    if (stream.live) this._ended = null;
    this.tick(performance.now());
  }

  /** The server says that nothing comes since then. */
  ended(since) {
    this._ended = since;
  }

  /** Begin or end watching; `visible` is whether it can be seen. */
  show(visible) {
    if (!visible) this._unwatch();
    else this._watch();
  }

  /** Ask for pictures of the size that the tile has now. */
  resize() {
    if (this._stop && this._wantedWidth() !== this._width) {
      this._unwatch();
      this._watch();
    }
  }

  close() {
    this._unwatch();
    this.element.remove();
  }

  /** Say how it stands. */
  tick(now) {
    const live = this._stop !== null && this._meter.isLive(now) && this._ended === null
      && this.stream.live;
    mark(this._canvas, "live", live);
    mark(this.element, "state", live ? "live" : this._reason());
    say(this._state, live ? "" : this._words(now));
    say(this._rate, live ? rate(this._meter.rate(now)) : "");
    say(this._age, live && this._sent ? duration(this._sent.ageMs + now - this._sent.at) : "");
  }

  _build(stream) {
    this._canvas = element("canvas", { width: 320, height: 240, "data-live": "false",
      "data-key": this.key });
    this._context = this._canvas.getContext("2d", { alpha: false });
    this._state = element("span", { class: "tile-state" });
    this._rate = element("span", { class: "tile-rate" });
    this._age = element("span", { class: "tile-age" });
    this.link = element("a", { href: `#${this.key}`, "aria-label": `Show ${streamName(stream)} large` },
      element("span", { class: "tile-picture" }, this._canvas, this._state),
      element("span", { class: "tile-caption" },
        element("i", { class: "lamp", "aria-hidden": "true" }),
        element("b", {}, stream.camera), element("span", { class: "topic" }, topicName(stream)),
        this._rate, this._age));
    this.element = element("li", { class: "tile", "data-key": this.key }, this.link);
  }

  _reason() {
    if (!this.stream.live || this._ended !== null) return "stopped";
    return this._meter.lastAt === null ? "waiting" : "stopped";
  }

  _words(now) {
    const since = !this.stream.live ? this.stream.since : this._ended;
    if (since !== null && since !== undefined) {
      const passed = duration(Math.max(0, this._serverNow() - since));
      return `${this.stream.live ? "no picture" : "gone"} since ${clock(since)}\n${passed}`;
    }
    if (this._watches.isLeftOut(this.key)) return "too many are in view at once";
    if (this._meter.lastAt === null || this._stop === null) return "waiting for a picture";
    return `no picture for ${duration(now - this._meter.lastAt)}`;
  }

  _wantedWidth() {
    const pixels = (this.element.clientWidth || 320) * Math.min(devicePixelRatio || 1, 2);
    return WIDTHS.find((width) => width >= pixels * 0.9) ?? WIDTHS.at(-1);
  }

  _watch() {
    if (this._stop) return;
    this._width = this._wantedWidth();
    this._decoder = new NewestDecoder((picture, bitmap) => this._decoded(picture, bitmap),
      () => mark(this._canvas, "broken", true));
    const decoder = this._decoder;
    const size = { width: this._width, quality: QUALITY };
    this._stop = this._watches.picture(this.key, size, (picture, taken) => {
      this._meter.add(performance.now(), picture);
      this._ended = null;
      decoder.offer(picture, () => this._paced(taken));
    });
  }

  _unwatch() {
    this._stop?.();
    this._stop = null;
    this._decoder?.close();
    this._decoder = null;
    this._forget();
  }

  /** What was seen before is not live: begin as if nothing had come yet. */
  _forget() {
    this._meter = new Meter();
    this._sent = null;
    this._nextAt = 0;
    this._bitmap?.close();
    this._bitmap = null;
  }

  /** Say "taken" not before this tile's time has come; the server then sends the newest. */
  _paced(taken) {
    const now = performance.now();
    const wait = this._nextAt - now;
    this._nextAt = Math.max(now, this._nextAt) + this._pace();
    if (wait > 1) setTimeout(taken, wait);
    else taken();
  }

  _decoded(picture, bitmap) {
    this._bitmap?.close();
    const isFirst = !this._bitmap;
    this._bitmap = bitmap;
    this._sent = picture;
    if (isFirst) requestAnimationFrame(() => this._paint());
  }

  _paint() {
    const bitmap = this._bitmap;
    if (!bitmap) return;
    this._bitmap = null;
    if (this._canvas.width !== bitmap.width || this._canvas.height !== bitmap.height) {
      this._canvas.width = bitmap.width;
      this._canvas.height = bitmap.height;
    }
    this._context.drawImage(bitmap, 0, 0);
    bitmap.close();
    const { epoch, seq } = this._sent.header;
    mark(this._canvas, "epoch", epoch);
    mark(this._canvas, "seq", seq);
    this.tick(performance.now());
  }
}
