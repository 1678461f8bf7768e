// Which pictures and messages belong together: those of the same epoch and sequence number.
//
// One stream leads: the picture that is shown large. It waits for its messages, but not for ever:
// two frame times after it came, it is released without them. For pictures that stand beside it,
// it waits longer. It does not wait at all for what cannot come any more, because that stream is
// already further on or has been silent. Frames are released in order; a newer one that is complete goes before
// older ones that are not, and those are dropped. No clock, no document: times are arguments.

import { between } from "./wire.js";

const PATIENCE_FRAMES = 2;
const PATIENCE_TOGETHER_FRAMES = 12; // where being of one frame matters more than being new
const FIRST_GUESS_MS = 50;
const SILENT_MS = 1000;
const INTERVALS = 15;
const FRAMES_KEPT = 128;

/** @typedef {{epoch: string, seq: number, stamp_ns: string}} Header */

export class Joiner {
  /** @param discard called with each item that will never be released */
  constructor(discard = () => {}) {
    this.onlyComplete = false;
    this._discard = discard;
    this.follow([], [], 0);
  }

  /** Begin anew. The first of `pictures` leads; the others and `messages` are its parts. */
  follow(pictures, messages, now) {
    for (const frame of this._frames?.values() ?? []) this._drop(frame);
    this._lead = pictures[0] ?? null;
    this._hasOthers = pictures.length > 1;
    this._parts = new Map();
    for (const key of [...pictures.slice(1), ...messages]) {
      this._parts.set(key, { at: now, epoch: null, seq: -1, lag: null });
    }
    this._frames = new Map();
    this._arrivals = new Map();
    this._epoch = null;
    this._taken = -1;
    this._last = null;
    this._intervals = [];
  }

  /** Milliseconds from one captured frame to the next, as the stamps tell. */
  get frameTime() {
    if (!this._intervals.length) return FIRST_GUESS_MS;
    return [...this._intervals].sort((a, b) => a - b)[this._intervals.length >> 1];
  }

  /** How long the newest part of a stream came after its picture, ms; null if not known. */
  lag(key) {
    return this._parts.get(key)?.lag ?? null;
  }

  /** Hand over one picture or message of a followed stream. */
  offer(key, header, item, now) {
    if (key === this._lead) this._offerLead(header, item, now);
    else if (this._parts.has(key)) this._offerPart(key, header, item, now);
    else this._discard(item);
  }

  /** Return the next frame to show, or null: {epoch, seq, header, items, missing, waited}. */
  take(now) {
    const waiting = this._waiting();
    const complete = waiting.filter((frame) => !this._missing(frame).length);
    const chosen = complete.at(-1) ?? waiting.filter((frame) => this._settled(frame, now)).at(-1);
    if (!chosen) return null;
    const missing = this._missing(chosen);
    this._frames.delete(chosen.id);
    this._forgetUpTo(chosen.seq);
    if (missing.length && this.onlyComplete) {
      this._drop(chosen);
      return null;
    }
    const { epoch, seq, header, items } = chosen;
    return { epoch, seq, header, items, missing, waited: now - chosen.at };
  }

  /** When `take` should be asked again though nothing came; null if nothing waits. */
  due() {
    const oldest = this._waiting()[0];
    return oldest ? oldest.at + this._patience() : null;
  }

  _offerLead(header, picture, now) {
    const { epoch, seq } = header;
    if (epoch !== this._epoch) this._beginEpoch(epoch);
    if (seq <= this._taken) {
      this._discard(picture);
      return;
    }
    this._measure(header);
    const frame = this._frame(header);
    this._put(frame, this._lead, picture);
    frame.header = header;
    frame.at = now;
    this._arrivals.set(frame.id, now);
    if (this._arrivals.size > FRAMES_KEPT) {
      this._arrivals.delete(this._arrivals.keys().next().value);
    }
  }

  _offerPart(key, header, item, now) {
    const part = this._parts.get(key);
    const id = identity(header);
    Object.assign(part, { at: now, epoch: header.epoch, seq: header.seq });
    const arrival = this._arrivals.get(id);
    if (arrival !== undefined) part.lag = now - arrival;
    if (header.epoch === this._epoch && header.seq <= this._taken) this._discard(item);
    else this._put(this._frame(header), key, item);
  }

  _beginEpoch(epoch) {
    this._epoch = epoch;
    this._taken = -1;
    this._last = null;
    for (const frame of [...this._frames.values()]) {
      if (frame.epoch !== epoch) this._forget(frame);
    }
  }

  _measure(header) {
    if (this._last && header.seq > this._last.seq) {
      const frames = header.seq - this._last.seq;
      const each = between(this._last.stamp_ns, header.stamp_ns) / frames;
      if (each > 0) this._intervals.push(each);
      if (this._intervals.length > INTERVALS) this._intervals.shift();
    }
    this._last = header;
  }

  _frame(header) {
    const id = identity(header);
    let frame = this._frames.get(id);
    if (!frame) {
      frame = { id, epoch: header.epoch, seq: header.seq, header, items: new Map(), at: null };
      this._frames.set(id, frame);
      if (this._frames.size > FRAMES_KEPT) this._forget(this._frames.values().next().value);
    }
    return frame;
  }

  _put(frame, key, item) {
    if (frame.items.has(key)) this._discard(frame.items.get(key));
    frame.items.set(key, item);
  }

  /** Frames whose picture is here, oldest first. */
  _waiting() {
    return [...this._frames.values()]
      .filter((frame) => frame.at !== null && frame.epoch === this._epoch)
      .sort((a, b) => a.seq - b.seq);
  }

  _missing(frame) {
    return [...this._parts.keys()].filter((key) => !frame.items.has(key));
  }

  _patience() {
    const isTogether = this.onlyComplete || this._hasOthers;
    return (isTogether ? PATIENCE_TOGETHER_FRAMES : PATIENCE_FRAMES) * this.frameTime;
  }

  /** Tell whether waiting longer for a frame's missing parts is over, or of no use. */
  _settled(frame, now) {
    if (now - frame.at >= this._patience()) return true;
    return this._missing(frame).every((key) => !this._mayCome(key, frame, now));
  }

  _mayCome(key, frame, now) {
    const part = this._parts.get(key);
    if (part.epoch === frame.epoch && part.seq > frame.seq) return false;
    return now - part.at <= Math.max(SILENT_MS, 3 * this.frameTime);
  }

  _forgetUpTo(seq) {
    this._taken = seq;
    for (const frame of [...this._frames.values()]) {
      if (frame.epoch === this._epoch && frame.seq <= seq) this._forget(frame);
    }
  }

  _forget(frame) {
    this._frames.delete(frame.id);
    this._drop(frame);
  }

  _drop(frame) {
    for (const item of frame.items.values()) this._discard(item);
  }
}

/** A frame's identity as one text. */
export function identity(header) {
  return `${header.epoch}:${header.seq}`;
}
