// All picture streams at once. Only tiles that can be seen are watched, in their own size, and
// together they get no more pictures a second than a small machine can make and a page decode.

import { byId, element, say } from "./elements.js";
import { inOrder, RAW, streamName, topicName } from "./naming.js";
import { recall, remember } from "./preferences.js";
import { Tile } from "./tile.js";
import { milliseconds } from "./wire.js";

const PICTURES_PER_SECOND = 150;
const FASTEST_HZ = 30;
const SLOWEST_HZ = 4;
const TICK_MS = 250;
const LARGEST_TILE = 640;
const SMALLEST_TILE = 260;

export class Wall {
  constructor(system, watches, connection) {
    this._system = system;
    this._watches = watches;
    this._tiles = new Map();
    this._seen = new Set();
    this._open = false;
    this._list = byId("tiles");
    this._filter = byId("filter");
    this._hidden = new Set(recall("hiddenTopics", [RAW]));
    this._observer = new IntersectionObserver((entries) => this._look(entries),
      { rootMargin: "64px" });
    new ResizeObserver(() => this._resize()).observe(this._list);
    this._filter.addEventListener("input", () => this._arrange());
    this._filter.addEventListener("keydown", (event) => this._leaveFilter(event));
    this._sizes();
    system.on("streams", () => this._arrange());
    connection.on("ended", ({ key, since_ns: since }) => {
      this._tiles.get(key)?.ended(milliseconds(since));
    });
    setInterval(() => this._tick(), TICK_MS);
  }

  /** Be seen or not; not seen, it watches nothing. */
  show(visible) {
    this._open = visible;
    for (const key of this._seen) this._tiles.get(key)?.show(visible);
  }

  /** Move the focus among tiles: "ArrowLeft" and so on. Returns whether it did. */
  move(key) {
    const links = [...this._list.querySelectorAll("a")];
    if (!links.length) return false;
    const at = links.indexOf(document.activeElement);
    if (at < 0) {
      links[0].focus();
      return true;
    }
    const columns = getComputedStyle(this._list).gridTemplateColumns.split(" ").length;
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns }[key];
    links[at + step]?.focus();
    return true;
  }

  /** Give the focus to the tile of a key. */
  focus(key) {
    this._tiles.get(key)?.link.focus();
  }

  _arrange() {
    const all = inOrder(this._system.streams);
    const words = this._filter.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const shown = all.filter((stream) => !this._hidden.has(topicName(stream))
      && words.every((word) => `${streamName(stream)} ${stream.key}`.includes(word)));
    const keys = new Set(shown.map((stream) => stream.key));
    for (const [key, tile] of this._tiles) if (!keys.has(key)) this._remove(key, tile);
    shown.forEach((stream, index) => this._place(stream, index));
    this._chips(all);
    const cameras = new Set(shown.map((stream) => stream.camera)).size;
    say(byId("wall-count"), all.length === 0 ? ""
      : `${shown.length === all.length ? all.length : `${shown.length} of ${all.length}`} streams, ${
        cameras} ${cameras === 1 ? "camera" : "cameras"}`);
    byId("wall-empty").hidden = all.length > 0;
    this._setSize();
    byId("wall-none").hidden = all.length === 0 || shown.length > 0;
  }

  _place(stream, index) {
    let tile = this._tiles.get(stream.key);
    if (tile) tile.update(stream);
    else {
      tile = new Tile(stream, this._watches, () => this._pace(), () => this._system.now);
      this._tiles.set(stream.key, tile);
      this._observer.observe(tile.element);
    }
    if (this._list.children[index] !== tile.element) {
      this._list.insertBefore(tile.element, this._list.children[index] ?? null);
    }
  }

  _remove(key, tile) {
    this._observer.unobserve(tile.element);
    this._seen.delete(key);
    this._tiles.delete(key);
    tile.close();
  }

  _look(entries) {
    for (const { target, isIntersecting } of entries) {
      const tile = this._tiles.get(target.dataset.key);
      if (!tile) continue;
      if (isIntersecting) this._seen.add(tile.key);
      else this._seen.delete(tile.key);
      tile.show(isIntersecting && this._open);
    }
  }

  /** Least time between two pictures of one tile, ms: fewer each, the more are seen. */
  _pace() {
    const each = PICTURES_PER_SECOND / Math.max(1, this._seen.size);
    return 1000 / Math.min(FASTEST_HZ * 1.5, Math.max(SLOWEST_HZ, each));
  }

  /** Buttons that hide and show all streams of one topic. */
  _chips(all) {
    const counts = new Map();
    for (const stream of all) {
      counts.set(topicName(stream), (counts.get(topicName(stream)) ?? 0) + 1);
    }
    const state = JSON.stringify([[...counts], [...this._hidden]]);
    if (state === this._chipState) return;
    this._chipState = state;
    const focused = document.activeElement?.dataset?.topic;
    byId("topics").replaceChildren(...[...counts].map(([topic, count]) => element("button", {
      type: "button", class: "chip", "data-topic": topic,
      "aria-pressed": String(!this._hidden.has(topic)),
      title: `Show or hide all ${topic} streams`,
      onclick: () => this._toggle(topic),
    }, topic, element("small", {}, String(count)))));
    if (focused) byId("topics").querySelector(`[data-topic="${CSS.escape(focused)}"]`)?.focus();
  }

  _toggle(topic) {
    if (this._hidden.has(topic)) this._hidden.delete(topic);
    else this._hidden.add(topic);
    remember("hiddenTopics", [...this._hidden]);
    this._arrange();
  }

  /** The slider for the tiles' width; until it is touched, all tiles are to fit on the screen. */
  _sizes() {
    this._size = recall("tileSize", null);
    byId("tile-size").addEventListener("input", ({ target }) => {
      this._size = Number(target.value);
      remember("tileSize", this._size);
      this._setSize();
    });
  }

  _setSize() {
    const size = this._size ?? this._fitting();
    byId("tile-size").value = size;
    this._list.style.setProperty("--tile", `${size}px`);
  }

  /** The largest width at which all tiles are seen without scrolling, or a small one. */
  _fitting() {
    const { clientWidth: width, clientHeight: height } = this._list;
    for (let columns = 1; columns <= this._tiles.size; columns += 1) {
      const each = Math.floor((width - 14 - 10 * columns) / columns);
      const rows = Math.ceil(this._tiles.size / columns);
      if (each <= LARGEST_TILE && rows * (each * 0.75 + 40) + 14 <= height) {
        return Math.max(each, SMALLEST_TILE);
      }
    }
    return SMALLEST_TILE;
  }

  _resize() {
    this._setSize();
    clearTimeout(this._resizeTimer);
    this._resizeTimer = setTimeout(() => {
      for (const tile of this._tiles.values()) tile.resize();
    }, 200);
  }

  _leaveFilter(event) {
    if (event.key !== "Escape") return;
    event.stopPropagation();
    this._filter.value = "";
    this._arrange();
    this._filter.blur();
  }

  _tick() {
    if (!this._open) return;
    const now = performance.now();
    for (const tile of this._tiles.values()) tile.tick(now);
  }
}
