// Pictures to bitmaps: one at a time a stream, the newest next, none queued behind it.

const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

/** Return a picture's bitmap; rejects if its bytes are no picture. */
export function decode(picture) {
  return createImageBitmap(new Blob([picture.data], { type: picture.mime }), EXACT);
}

export class NewestDecoder {
  /** `decoded(picture, bitmap)` owns the bitmap; `failed(picture, error)`. */
  constructor(decoded, failed = () => {}) {
    this._decoded = decoded;
    this._failed = failed;
    this._busy = false;
    this._next = null;
    this._closed = false;
  }

  /** Decode a picture soon, unless a newer one comes first; `taken` is called once either way. */
  offer(picture, taken) {
    this._next?.taken();
    this._next = { picture, taken };
    if (!this._busy) this._work();
  }

  /** Deliver nothing any more. */
  close() {
    this._closed = true;
    this._next?.taken();
    this._next = null;
  }

  async _work() {
    this._busy = true;
    while (this._next) {
      const { picture, taken } = this._next;
      this._next = null;
      try {
        const bitmap = await decode(picture);
        if (this._closed) bitmap.close();
        else this._decoded(picture, bitmap);
      } catch (error) {
        this._failed(picture, error);
      }
      taken();
    }
    this._busy = false;
  }
}
