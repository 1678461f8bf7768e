// One stream large, others of its camera beside it, all of the same frame, with overlay.

import { Choices } from "./choices.js";
import { byId, mark, say } from "./elements.js";
import { Figures } from "./figures.js";
import { clock, duration } from "./format.js";
import { FrameFeed } from "./frames.js";
import { inOrder, topicName } from "./naming.js";
import { Pane } from "./pane.js";
import { Playback } from "./playback.js";
import { listenToPointer } from "./pointing.js";
import { saveDrawn, saveOriginal } from "./saving.js";
import { Zoom } from "./zooming.js";

const TICK_MS = 200;
const CAPTION_PX = 24;

export class Large {
  constructor(system, watches, connection, go) {
    this._system = system;
    this._connection = connection;
    this._go = go;
    this._feed = new FrameFeed(watches, connection);
    this._playback = new Playback((frame, isNew) => this._display(frame, isNew));
    this._zoom = new Zoom(() => this._zoomed());
    this._figures = new Figures();
    this._choices = new Choices(system, () => this._follow(), (keys) => go(keys));
    this._panes = [];
    this._keys = [];
    this._reset();
    this._feed.on("frame", (frame) => this._playback.arrived(frame));
    system.on("streams", () => this._keys.length && this._follow());
    this._observer = new ResizeObserver(() => this._resized());
    setInterval(() => this._tick(), TICK_MS);
  }

  get isOpen() {
    return this._keys.length > 0;
  }

  /** The key of the stream that leads, or null. */
  get key() {
    return this._keys[0] ?? null;
  }

  /** The camera of the stream that leads, or null. */
  get camera() {
    return this._lead?.camera ?? null;
  }

  /** Show these streams; the first leads. */
  open(keys) {
    const isOther = keys[0] !== this._keys[0];
    this._keys = keys;
    if (isOther) this._reset();
    this._followed = null;
    this._follow();
  }

  close() {
    this._keys = [];
    this._followed = null;
    this._feed.close();
    this._reset();
    this._setPanes([]);
  }

  // ---- what buttons and keys do

  togglePause() {
    this._playback.toggle();
    byId("pause").setAttribute("aria-pressed", String(this._playback.paused));
    this._tick();
  }

  /** Show the frame before (-1) or after (1), and pause. */
  step(by) {
    if (!this._playback.paused) this.togglePause();
    this._playback.step(by);
  }

  zoom(factor, at = undefined) {
    if (this._frame) this._zoom.zoom(factor, this._frame.header, this._panes[0].size, at);
  }

  pan(dx, dy) {
    if (this._frame) this._zoom.pan(dx, dy, this._frame.header);
  }

  fit() {
    this._zoom.fit();
  }

  actual(at = undefined) {
    if (this._frame) this._zoom.actual(at);
  }

  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else byId("large").requestFullscreen?.();
  }

  toggleOverlay() {
    this._choices.toggleAll();
  }

  save() {
    if (this._frame?.items.get(this._lead.key)) saveOriginal(this._frame, this._lead);
  }

  saveDrawn() {
    if (this._frame?.items.get(this._lead.key)) {
      saveDrawn(this._frame, this._lead, this._overlay(this._panes[0]));
    }
  }

  /** Show the next stream of the wall's order (1), or the one before (-1). */
  neighbour(by) {
    const all = inOrder(this._system.streams);
    const at = all.findIndex((stream) => stream.key === this._keys[0]);
    if (all.length) this._go([all[(at + by + all.length) % all.length].key]);
  }

  // ---- frames

  _reset() {
    this._playback.reset();
    this._zoom.reset();
    this._figures.clear();
    this._frame = null;
    this._pointer = null;
    byId("pause").setAttribute("aria-pressed", "false");
  }

  /** Follow what is chosen and there; again only if that changed. */
  _follow() {
    const streams = this._keys.map((key) => this._system.stream(key)).filter(Boolean);
    this._lead = this._system.stream(this._keys[0]) ?? null;
    this._title();
    if (!this._lead) return;
    const pictures = streams.map((stream) => stream.key);
    const messages = this._choices.overlayKeys(this._lead.camera);
    this._choices.write(this._keys, this._lead.camera);
    byId("overlay-toggle").setAttribute("aria-pressed", String(this._choices.isOn));
    this._feed.joiner.onlyComplete = this._choices.onlyComplete;
    const followed = JSON.stringify([pictures, messages]);
    if (followed !== this._followed) {
      this._followed = followed;
      this._setPanes(streams);
      this._figures.clear();
      this._feed.follow(pictures, messages);
    }
    this._requestPaint();
  }

  _setPanes(streams) {
    const kept = new Map(this._panes.map((pane) => [pane.key, pane]));
    this._panes = streams.map((stream) => kept.get(stream.key) ?? this._newPane(stream));
    for (const pane of kept.values()) {
      if (!this._panes.includes(pane)) {
        this._observer.unobserve(pane.surface);
        pane.close();
      }
    }
    byId("panes").replaceChildren(...this._panes.map((pane) => pane.element));
    mark(byId("panes"), "count", this._panes.length);
    this._resized();
  }

  _newPane(stream) {
    const pane = new Pane(stream);
    this._observer.observe(pane.surface);
    listenToPointer(pane.surface, {
      moved: (at) => this._pointed(pane, at),
      dragged: (dx, dy) => this.pan(dx, dy),
      zoomed: (factor, at) => this.zoom(factor, at),
      doubled: (at) => (this._zoom.mode === "fit"
        ? this.actual(pane.locate(this._zoom.view, at, this._frame.header) ?? undefined)
        : this.fit()),
    });
    return pane;
  }

  _display(frame, isNew) {
    const before = this._frame?.header;
    this._frame = frame;
    for (const pane of this._panes) pane.take(frame);
    if (isNew) {
      const isComplete = !frame.missing.some((key) => this._feed.messages.includes(key));
      this._figures.add(performance.now(), isComplete);
    }
    const { width, height } = frame.header;
    if (before?.width !== width || before.height !== height) {
      this._zoom.fit();
      this._resized();
    }
    this._requestPaint();
  }

  // ---- painting

  _requestPaint() {
    this._painting ??= requestAnimationFrame(() => {
      this._painting = null;
      this._paint();
    });
  }

  _paint() {
    if (!this._frame || !this._lead) return;
    this._zoom.settle(this._frame.header, this._panes[0].size);
    for (const pane of this._panes) {
      pane.paint(this._frame, this._zoom.view, this._overlay(pane), this._pointer);
    }
    const { words, isWithout } = this._figures.joining(this._frame, this._feed, this._feed.messages);
    this._panes[0].badge(words, isWithout);
    this._tellPixel();
  }

  /** What is drawn over a pane: nothing where the tracker has drawn already. */
  _overlay(pane) {
    const isDrawn = topicName(this._system.stream(pane.key) ?? this._lead) === "tracked";
    const keys = isDrawn ? [] : this._feed.messages;
    return { keys, trails: this._choices.trails ? this._feed.trails : null };
  }

  _zoomed() {
    const { mode } = this._zoom;
    mark(byId("panes"), "mode", mode);
    byId("fit").setAttribute("aria-pressed", String(mode === "fit"));
    byId("actual").setAttribute("aria-pressed", String(mode === "actual"));
    this._requestPaint();
  }

  /** As many columns as make the pictures largest. */
  _layOut() {
    const { clientWidth: width, clientHeight: height } = byId("panes");
    const { width: frameWidth, height: frameHeight } = this._frame?.header ?? { width: 4, height: 3 };
    const count = this._panes.length;
    const scale = (columns) => Math.min(width / columns / frameWidth,
      (height / Math.ceil(count / columns) - CAPTION_PX) / frameHeight);
    const columns = [1, 2, 3, 4].reduce((best, each) => (scale(each) > scale(best) ? each : best));
    byId("panes").style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
  }

  _resized() {
    this._layOut();
    for (const pane of this._panes) pane.fitToSurface();
    this._requestPaint();
  }

  _pointed(pane, at) {
    if (!this._frame) return;
    this._pointer = at && pane.locate(this._zoom.view, at, this._frame.header);
    this._requestPaint();
  }

  _tellPixel() {
    const point = this._pointer;
    const zoom = this._zoom.view.scale;
    const place = point ? `${Math.floor(point.x)}, ${Math.floor(point.y)}` : "–";
    const isAlone = point && this._panes.length === 1;
    say(byId("pixel"), isAlone ? `${place} = ${this._panes[0].value}` : place);
    say(byId("zoom"), `${zoom >= 1 ? Number(zoom.toFixed(2)) : Number(zoom.toPrecision(2))}×`);
  }

  // ---- how it stands

  _title() {
    say(byId("large-camera"), this._lead?.camera ?? "");
    say(byId("large-topic"), this._lead ? topicName(this._lead) : this._keys[0] ?? "");
  }

  _tick() {
    if (!this.isOpen) return;
    const live = this._connection.isOpen && !this._playback.paused && Boolean(this._lead?.live)
      && this._feed.isLive(performance.now());
    const words = live ? "" : this._words();
    mark(byId("large"), "live", live);
    mark(byId("large"), "paused", this._playback.paused);
    say(byId("large-state"), this._playback.paused ? "paused" : live ? "live" : "not live");
    byId("unknown").hidden = Boolean(this._lead);
    for (const pane of this._panes) pane.judge(live, words);
    this._figures.write(this._frame, this._feed, this._lead?.key ?? "", this._playback.paused, live);
  }

  _words() {
    if (this._playback.paused) return "";
    if (!this._connection.isOpen) return "not connected to the viewer's server";
    const since = !this._lead?.live ? this._lead?.since ?? null : this._feed.endedSince;
    if (since !== null) {
      const what = this._lead.live ? "no picture" : "gone";
      return `${what} since ${clock(since)} (${duration(Math.max(0, this._system.now - since))})`;
    }
    const now = performance.now();
    const { lastAt } = this._feed.meter(this._lead?.key ?? "");
    if (lastAt === null) return "waiting for a picture";
    if (now - lastAt < 1000) return "waiting for a frame with its overlay";
    return `no picture for ${duration(now - lastAt)}`;
  }
}
