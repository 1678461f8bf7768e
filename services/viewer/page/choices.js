// The large view's two menus: what is drawn over the picture, and what stands beside it.

import { byId, element } from "./elements.js";
import { inOrder, overlayStreams, topicName } from "./naming.js";
import { recall, remember } from "./preferences.js";

export class Choices {
  /** `changed()` is called after each choice; `beside(keys)` with what shall stand beside. */
  constructor(system, changed, beside) {
    this._system = system;
    this._changed = changed;
    this._beside = beside;
    this._drawn = recall("overlays", {});
    this.isOn = recall("overlayOn", true);
    this.trails = recall("trails", true);
    this.onlyComplete = recall("onlyComplete", false);
  }

  /** The message streams to draw over the pictures of a camera. */
  overlayKeys(camera) {
    if (!this.isOn) return [];
    return overlayStreams(this._system.streams, camera)
      .filter((stream) => this._isDrawn(stream)).map((stream) => stream.key);
  }

  toggleAll() {
    this.isOn = !this.isOn;
    remember("overlayOn", this.isOn);
    this._changed();
  }

  /** Write both menus for the streams that are there now; `keys` stand in the view. */
  write(keys, camera) {
    const overlays = overlayStreams(this._system.streams, camera);
    const others = inOrder(this._system.streams).filter((stream) => stream.camera === camera);
    const state = JSON.stringify([keys, overlays.map((s) => [s.key, s.live]), this._drawn,
      others.map((s) => [s.key, s.live]), this.isOn, this.trails, this.onlyComplete]);
    if (state === this._state) return;
    this._state = state;
    fill(byId("overlay-menu"), [
      ...overlays.map((stream) => check(stream.topic, this.isOn && this._isDrawn(stream),
        (on) => this._draw(stream, on), stream.live ? "" : "gone")),
      overlays.length ? null : element("p", {}, "This camera has no centroid and no tracks."),
      element("hr"),
      check("trails of 2 s", this.trails, (on) => this._set("trails", on)),
      check("only frames with their overlay", this.onlyComplete,
        (on) => this._set("onlyComplete", on), "",
        "The picture then waits longer for its messages, and is dropped if they do not come"),
    ]);
    fill(byId("beside-menu"), others.map((stream) => check(topicName(stream),
      keys.includes(stream.key), (on) => this._stand(keys, stream.key, on),
      stream.live ? "" : "gone")));
  }

  /** Unless the user chose: the centroid, and of the tracks the tracker's before the truth. */
  _isDrawn(stream) {
    const chosen = this._drawn[stream.topic];
    if (chosen !== undefined) return chosen;
    if (stream.topic !== "truth") return true;
    return !this._system.streams.some((other) => other.camera === stream.camera
      && other.topic === "tracks");
  }

  _draw(stream, on) {
    if (!this.isOn) {
      // All was off: what is chosen now is the only thing that is on.
      for (const other of overlayStreams(this._system.streams, stream.camera)) {
        this._drawn[other.topic] = false;
      }
      this.isOn = true;
      remember("overlayOn", true);
    }
    this._drawn[stream.topic] = on;
    remember("overlays", this._drawn);
    this._changed();
  }

  _set(name, on) {
    this[name] = on;
    remember(name, on);
    this._changed();
  }

  _stand(keys, key, on) {
    const next = on ? [...keys, key] : keys.filter((other) => other !== key);
    if (next.length) this._beside(next);
    else this._changed();
  }
}

function check(words, checked, chosen, remark = "", title = null) {
  return element("label", { title },
    element("input", { type: "checkbox", checked, "data-choice": words,
      onchange: (event) => chosen(event.target.checked) }),
    element("span", {}, words), remark ? element("small", {}, remark) : null);
}

/** Replace a menu's rows and keep the focus on the same row. */
function fill(menu, rows) {
  const focused = document.activeElement?.dataset?.choice;
  const had = menu.contains(document.activeElement);
  menu.replaceChildren(...rows.filter(Boolean));
  if (had && focused) menu.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus();
}

/** A menu closes when something else is clicked, or at Escape. */
export function closeMenus(except = null) {
  let closed = false;
  for (const menu of document.querySelectorAll("details.menu[open]")) {
    if (menu === except) continue;
    if (menu.contains(document.activeElement)) menu.querySelector("summary").focus();
    menu.open = false;
    closed = true;
  }
  return closed;
}

document.addEventListener("pointerdown", (event) => {
  closeMenus(event.target.closest("details.menu"));
});
