// Pause and step: frames that come are shown, or kept back; those that were shown can come again.

import { decode } from "./decoding.js";
import { release } from "./frames.js";
import { RecentFrames } from "./recent.js";

export class Playback {
  /** `display(frame, isNew)` shows a frame and owns its bitmaps. */
  constructor(display) {
    this._display = display;
    this._recent = new RecentFrames();
    this.reset();
  }

  reset() {
    this._recent.clear();
    this.paused = false;
    this._index = null;
    this._wantsOne = false;
  }

  /** A frame came. */
  arrived(frame) {
    if (this.paused && !this._wantsOne) {
      for (const item of frame.items.values()) release(item);
      return;
    }
    this._wantsOne = false;
    this._recent.add(frame);
    if (this.paused) this._index = this._recent.length - 1;
    this._display(frame, true);
  }

  toggle() {
    this.paused = !this.paused;
    this._index = this.paused ? this._recent.length - 1 : null;
    this._wantsOne = false;
  }

  /** Show the frame before (-1) or after (1) the one that stands; past the newest, the next. */
  async step(by) {
    const index = this._index + by;
    if (index < 0) return;
    if (index >= this._recent.length) {
      this._wantsOne = true;
      return;
    }
    this._index = index;
    const kept = this._recent.at(index);
    const items = new Map(kept.items);
    for (const [key, item] of items) {
      if (!item?.picture) continue;
      items.set(key, { picture: item.picture, bitmap: await decode(item.picture) });
    }
    if (this.paused && this._index === index) this._display({ ...kept, items }, false);
    else for (const item of items.values()) release(item);
  }
}
