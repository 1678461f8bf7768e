// The last frames as they came, undecoded, so that one can step back through them.

const MOST_BYTES = 32_000_000;
const MOST_FRAMES = 300;

export class RecentFrames {
  constructor() {
    this.clear();
  }

  clear() {
    this._frames = [];
    this._bytes = 0;
  }

  get length() {
    return this._frames.length;
  }

  at(index) {
    return this._frames[index];
  }

  /** Keep a joined frame: its pictures' bytes and its messages, not its bitmaps. */
  add(frame) {
    const items = new Map();
    let bytes = 0;
    for (const [key, item] of frame.items) {
      const isPicture = item?.bitmap !== undefined;
      items.set(key, isPicture ? { picture: item.picture } : item);
      if (isPicture) bytes += item.picture.data.byteLength;
    }
    this._frames.push({ ...frame, items, bytes });
    this._bytes += bytes;
    while (this._frames.length > 1
        && (this._bytes > MOST_BYTES || this._frames.length > MOST_FRAMES)) {
      this._bytes -= this._frames.shift().bytes;
    }
  }
}
