// What the large view looks at: the whole frame, one to one, or a part that the user chose.

import { fit, panned, zoomed } from "./viewport.js";

export class Zoom {
  constructor(changed) {
    this._changed = changed;
    this.reset();
  }

  reset() {
    this.mode = "fit";
    this.view = { scale: 1, x: 0, y: 0 };
  }

  /** Fit a frame into a pane again, if that is what is wanted. */
  settle(frame, pane) {
    if (this.mode === "fit") this.view = fit(frame, pane);
  }

  zoom(factor, frame, pane, at = { x: pane.width / 2, y: pane.height / 2 }) {
    this._set("free", zoomed(this.view, frame, pane, factor, at));
  }

  /** Move the picture by device pixels; a whole frame stays where it is. */
  pan(dx, dy, frame) {
    if (this.mode !== "fit") this._set("free", panned(this.view, frame, dx, dy));
  }

  fit() {
    this._set("fit", this.view);
  }

  /** One pixel of the frame on one of the screen; `at`, of the frame, comes to the middle. */
  actual(at = this.view) {
    this._set("actual", { scale: 1, x: at.x, y: at.y });
  }

  _set(mode, view) {
    this.mode = mode;
    this.view = view;
    this._changed();
  }
}
