// Which streams this page watches: one watch a key, whoever wants it, again after a reconnect,
// none while nobody looks at the page, and never more than the server allows.

const MOST = 30; // the server's limit is 32
const SETTLE_MS = 60; // scrolling by a tile must not cost a watch and an unwatch
const HIDDEN_MS = 2000;

export class Watches {
  constructor(connection) {
    this._connection = connection;
    this._pictures = new Map();
    this._messages = new Map();
    this._sent = new Map();
    this._hidden = false;
    connection.on("open", () => {
      this._sent.clear();
      this._settle();
    });
    connection.on("picture", (picture) => this._deliverPicture(picture));
    connection.on("message", (message) => this._deliverMessage(message));
    document.addEventListener("visibilitychange", () => this._visibility());
  }

  /**
   * Watch a picture stream, at `size` ({width, height, quality}) or as it is.
   *
   * `receive(picture, taken)` must call `taken` once, when it is ready for the next. The last who
   * asked for a key gets it. Returns a function that ends it.
   */
  picture(key, size, receive) {
    const entry = { size, receive, isPicture: true };
    this._pictures.set(key, entry);
    this._later();
    return () => {
      if (this._pictures.get(key) === entry) this._pictures.delete(key);
      this._later();
    };
  }

  /** Watch a message stream together with others; returns a function that ends it. */
  messages(key, receive) {
    if (!this._messages.has(key)) this._messages.set(key, new Set());
    this._messages.get(key).add(receive);
    this._later();
    return () => {
      this._messages.get(key)?.delete(receive);
      if (!this._messages.get(key)?.size) this._messages.delete(key);
      this._later();
    };
  }

  /** Tell whether a stream is wanted, but not watched, because that would be too many. */
  isLeftOut(key) {
    return this._sent.size >= MOST && !this._sent.has(key) && this._pictures.has(key);
  }

  _wanted() {
    if (this._hidden) return new Map();
    const wanted = new Map();
    for (const key of this._messages.keys()) wanted.set(key, {});
    for (const [key, entry] of this._pictures) {
      if (wanted.size < MOST) wanted.set(key, entry.size ?? {});
    }
    return wanted;
  }

  _later() {
    this._timer ??= setTimeout(() => this._settle(), SETTLE_MS);
  }

  _settle() {
    clearTimeout(this._timer);
    this._timer = null;
    if (!this._connection.isOpen) return;
    const wanted = this._wanted();
    for (const key of [...this._sent.keys()]) {
      if (wanted.has(key)) continue;
      this._connection.send({ op: "unwatch", key });
      this._sent.delete(key);
    }
    for (const [key, size] of wanted) {
      const words = JSON.stringify(size);
      if (this._sent.get(key) === words) continue;
      this._connection.send({ op: "watch", key, ...size });
      this._sent.set(key, words);
    }
  }

  _deliverPicture(picture) {
    const { key } = picture;
    let told = false;
    const taken = () => {
      if (!told) this._connection.shown(key);
      told = true;
    };
    const entry = this._pictures.get(key);
    if (entry) entry.receive(picture, taken);
    else taken();
  }

  _deliverMessage(message) {
    for (const receive of this._messages.get(message.key) ?? []) receive(message);
  }

  /** A page that nobody sees costs nobody anything. */
  _visibility() {
    clearTimeout(this._hideTimer);
    if (document.hidden) {
      this._hideTimer = setTimeout(() => {
        this._hidden = true;
        this._settle();
      }, HIDDEN_MS);
    } else if (this._hidden) {
      this._hidden = false;
      this._settle();
    }
  }
}
