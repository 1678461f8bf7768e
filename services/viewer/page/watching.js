// Which streams this page watches: one watch a key, whoever wants it, again after a reconnect,
// none while nobody looks at the page, and never more than the server allows.

const MOST = 30; // the server's limit is 32
const SETTLE_MS = 60; // scrolling by a tile must not cost a watch and an unwatch
const HIDDEN_MS = 2000;

export class Watches {
	constructor(connection) {
		this.connection = connection;
		this.pictures = new Map();
		this._messages = new Map();
		this.sent = new Map();
		this.hidden = false;
		connection.on("open", () => {
			this.sent.clear();
			this.settle();
		});
		connection.on("picture", (picture) => this.deliverPicture(picture));
		connection.on("message", (message) => this.deliverMessage(message));
		document.addEventListener("visibilitychange", () => this.visibility());
	}

	/**
	 * Watch a picture stream at `size` ({width, quality}), or as it is; returns what ends it.
	 * `receive(picture, taken)` calls `taken` when it is ready for the next.
	 */
	picture(key, size, receive) {
		const entry = { size, receive, isPicture: true };
		this.pictures.set(key, entry);
		this.later();
		return () => {
			if (this.pictures.get(key) === entry) this.pictures.delete(key);
			this.later();
		};
	}

	/** Watch a message stream together with others; returns a function that ends it. */
	messages(key, receive) {
		if (!this._messages.has(key)) this._messages.set(key, new Set());
		this._messages.get(key).add(receive);
		this.later();
		return () => {
			this._messages.get(key)?.delete(receive);
			if (!this._messages.get(key)?.size) this._messages.delete(key);
			this.later();
		};
	}

	/** Tell whether a stream is wanted, but not watched, because that would be too many. */
	isLeftOut(key) {
		return this.sent.size >= MOST && !this.sent.has(key) && this.pictures.has(key);
	}

	wanted() {
		if (this.hidden) return new Map();
		const wanted = new Map();
		for (const key of this._messages.keys()) wanted.set(key, {});
		for (const [key, entry] of this.pictures) {
			if (wanted.size < MOST) wanted.set(key, entry.size ?? {});
		}
		return wanted;
	}

	later() {
		this.timer ??= setTimeout(() => this.settle(), SETTLE_MS);
	}

	settle() {
		clearTimeout(this.timer);
		this.timer = null;
		if (!this.connection.isOpen) return;
		const wanted = this.wanted();
		for (const key of [...this.sent.keys()]) {
			if (wanted.has(key)) continue;
			this.connection.send({ op: "unwatch", key });
			this.sent.delete(key);
		}
		for (const [key, size] of wanted) {
			const words = JSON.stringify(size);
			if (this.sent.get(key) === words) continue;
			this.connection.send({ op: "watch", key, ...size });
			this.sent.set(key, words);
		}
	}

	deliverPicture(picture) {
		const { key } = picture;
		let told = false;
		const taken = () => {
			if (!told) this.connection.shown(key);
			told = true;
		};
		const entry = this.pictures.get(key);
		if (entry) entry.receive(picture, taken);
		else taken();
	}

	deliverMessage(message) {
		for (const receive of this._messages.get(message.key) ?? []) receive(message);
	}

	visibility() {
		clearTimeout(this.hideTimer);
		if (document.hidden) {
			this.hideTimer = setTimeout(() => {
				this.hidden = true;
				this.settle();
			}, HIDDEN_MS);
		} else if (this.hidden) {
			this.hidden = false;
			this.settle();
		}
	}
}
