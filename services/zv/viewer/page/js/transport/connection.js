// The WebSocket to the server: reconnects forever, drops a connection that is silent, and limits
// the rate of texts. Emits "open", "close", "picture" and each text by its `op`.

const FIRST_DELAY_MS = 250;
const LONGEST_DELAY_MS = 2000;
const SILENCE_MS = 6000;
const BURST = 20;
const TEXTS_PER_SECOND = 25; // the server allows 50 in any second
const REPLY_MS = 5000;
const LENGTH_BYTES = 4;

export class Events extends EventTarget {
	/** Call a listener at each event of the given names, separated by spaces. */
	on(names, listener) {
		for (const name of names.split(" ")) this.addEventListener(name, ({ detail }) => listener(detail));
	}

	emit(name, detail) {
		this.dispatchEvent(new CustomEvent(name, { detail }));
	}
}

export class Connection extends Events {
	constructor(address) {
		super();
		this.isOpen = false;
		this.silent = false;
		this.address = address;
		this.delay = FIRST_DELAY_MS;
		this.queue = [];
		this.credit = BURST;
		this.creditAt = 0;
		/** @type {any} */
		this.socket = null;
		/** @type {any} */
		this.timer = null; // of the next attempt
		this.reader = new PictureReader();
		this.receivedAt = 0;
		this.requests = new Map(); // id -> function that takes the reply
		this.nextId = 1;
		this.on("reply", (reply) => this.resolve(reply));
		setInterval(() => this.closeIfSilent(), 1000);
		document.addEventListener("visibilitychange", () => !document.hidden && this.timer && this.open());
		this.open();
	}

	/** Send one operation when the rate limit allows it; dropped while there is no connection. */
	send(operation) {
		if (!this.isOpen) return;
		this.queue.push(operation);
		this.flush();
	}

	flush() {
		clearTimeout(this.flushing);
		const now = performance.now();
		this.credit = Math.min(BURST, this.credit + (now - this.creditAt) * TEXTS_PER_SECOND / 1000);
		this.creditAt = now;
		while (this.queue.length && this.credit >= 1) {
			this.credit -= 1;
			this.socket.send(JSON.stringify(this.queue.shift()));
		}
		if (this.queue.length) this.flushing = setTimeout(() => this.flush(), 1000 / TEXTS_PER_SECOND);
	}

	/** Tell the server that a picture was taken. Not rate-limited: one is sent per picture. */
	shown(key) {
		if (this.isOpen) this.socket.send(JSON.stringify({ op: "shown", key }));
	}

	/** Send an operation and return its reply: {ok, error?, allowed?, ...}; never rejects. */
	request(operation) {
		const id = this.nextId;
		this.nextId += 1;
		return new Promise((resolve) => {
			this.requests.set(id, resolve);
			setTimeout(() => this.fail(id, "no reply from the viewer's server"), REPLY_MS);
			if (this.isOpen) this.send({ ...operation, id });
			else this.fail(id, "not connected to the viewer's server");
		});
	}

	fail(id, error) {
		this.resolve({ id, ok: false, error });
	}

	/** Pass a reply to its request, unless the request already has one. */
	resolve(reply) {
		this.requests.get(reply.id)?.(reply);
		this.requests.delete(reply.id);
	}

	open() {
		clearTimeout(this.timer);
		this.timer = null;
		const socket = new WebSocket(this.address);
		socket.binaryType = "arraybuffer";
		this.socket = socket;
		this.reader = new PictureReader();
		this.receivedAt = performance.now();
		socket.onopen = () => {
			this.isOpen = true;
			this.credit = BURST;
			this.emit("open");
		};
		socket.onmessage = (event) => this.receive(event.data);
		socket.onclose = () => this.closed();
	}

	receive(data) {
		this.receivedAt = performance.now();
		this.delay = FIRST_DELAY_MS;
		if (typeof data === "string") {
			const { op, ...fields } = JSON.parse(data);
			this.emit(op, fields);
		} else {
			const picture = this.reader.add(data, this.receivedAt);
			if (picture) this.emit("picture", picture);
		}
	}

	closed() {
		this.isOpen = false;
		this.queue = [];
		for (const id of this.requests.keys()) {
			this.fail(id, "the connection to the viewer's server was lost");
		}
		this.emit("close");
		this.timer = setTimeout(() => this.open(), this.delay * (0.75 + Math.random() / 2));
		this.delay = Math.min(2 * this.delay, LONGEST_DELAY_MS);
	}

	/**
	 * A connection whose other end is gone stays "open" for minutes, but receives no ticks. A page
	 * that stood still itself has not read yet what came, so it must be silent at two looks.
	 */
	closeIfSilent() {
		const wasSilent = this.silent;
		this.silent = !this.timer && performance.now() - this.receivedAt >= SILENCE_MS;
		if (!wasSilent || !this.silent) return;
		Object.assign(this.socket, { onopen: null, onmessage: null, onclose: null });
		this.socket.close();
		this.closed();
	}
}

/** Joins the binary messages that carry a picture: the server sends large ones in parts. */
export class PictureReader {
	/** Return the picture that a message completes, with `at`, the time of its beginning; or null. */
	add(buffer, now) {
		if (!this.picture) {
			const picture = { ...readPicture(buffer), at: now };
			this.filled = picture.data.length;
			if (this.filled >= picture.bytes) return picture;
			this.picture = { ...picture, data: new Uint8Array(picture.bytes) };
			this.picture.data.set(picture.data);
			return null;
		}
		const { picture } = this;
		picture.data.set(new Uint8Array(buffer), this.filled);
		this.filled += buffer.byteLength;
		if (this.filled < picture.bytes) return null;
		this.picture = null;
		return picture;
	}
}

/**
 * Decode the first message of a picture: a little-endian uint32 length, JSON of this length, bytes.
 * Throws a RangeError or SyntaxError if it is truncated or not JSON.
 */
function readPicture(buffer) {
	const length = new DataView(buffer).getUint32(0, true);
	const text = new TextDecoder().decode(new Uint8Array(buffer, LENGTH_BYTES, length));
	const { age_ms: ageMs, ...fields } = JSON.parse(text);
	return { ...fields, ageMs, data: new Uint8Array(buffer, LENGTH_BYTES + length) };
}

/**
 * Nanoseconds since 1970, a decimal string, as milliseconds since 1970; null stays null.
 * @returns {any}
 */
export function milliseconds(nanoseconds) {
	// A double represents current times in ms to better than 1 µs, but not in ns.
	if (nanoseconds === null || nanoseconds === undefined) return null;
	const whole = BigInt(nanoseconds);
	return Number(whole / 1_000_000n) + Number(whole % 1_000_000n) / 1e6;
}

/** Milliseconds from one stamp to another; both decimal strings of nanoseconds. */
export function between(earlier, later) {
	return Number(BigInt(later) - BigInt(earlier)) / 1e6;
}
