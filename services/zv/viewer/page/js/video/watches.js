// Watches streams at the server: one watch per key, renewed after a reconnect, ended while the page
// is hidden, and at most as many as the server allows. Pictures are decoded to bitmaps.

import { milliseconds } from "../transport/connection.js";
import { later } from "../ui/elements.js";

const MAX_WATCHES = 30; // the server's limit is 32
const SETTLE_MS = 60; // so that scrolling past a tile causes no watch and unwatch
const HIDDEN_MS = 2000;
const RETRY_MS = 5000;
/** @type {ImageBitmapOptions} */
const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

export class Watches {
	constructor(connection) {
		this.connection = connection;
		this.pictures = new Map(); // key -> {size, statistics, receive}
		this.messages = new Map(); // function -> the keys whose messages it receives
		this.sent = new Map(); // key -> size as JSON
		this.hidden = false;
		this.syncSoon = later(() => this.sync(), SETTLE_MS);
		connection.on("open", () => {
			this.sent.clear();
			this.sync();
		});
		connection.on("error", ({ key }) => { // tried again later, when others may watch less
			if (this.sent.has(key)) setTimeout(() => this.sent.delete(key) && this.sync(), RETRY_MS);
		});
		connection.on("picture", (picture) => {
			const watch = this.pictures.get(picture.key);
			if (watch) watch.receive(picture);
			else connection.shown(picture.key);
		});
		connection.on("ended", ({ key, since_ns: since }) => {
			const watch = this.pictures.get(key);
			if (watch) watch.statistics.endedSince = milliseconds(since);
		});
		connection.on("message", (message) => {
			for (const [receive, keys] of this.messages) if (keys.includes(message.key)) receive(message);
		});
		document.addEventListener("visibilitychange", () => {
			clearTimeout(this.hideTimer);
			this.hideTimer = setTimeout(() => {
				this.hidden = document.hidden;
				this.sync();
			}, document.hidden ? HIDDEN_MS : 0);
		});
	}

	/**
	 * Watch a picture stream, in a `size` of {width, quality, values}: without width and quality the
	 * pictures are unchanged; `values` asks for the values of 16 bits. Returns a function that ends
	 * the watch. `statistics` counts the pictures. One picture is decoded at a time, then the
	 * newest. `decoded(picture, bitmap)` owns the bitmap; `delay(taken)` may delay the request for
	 * the next picture.
	 */
	watchPictures(key, size, statistics, decoded, delay = (taken) => taken()) {
		let next = null; // the newest picture that is not decoded
		let busy = false;
		const taken = () => this.connection.shown(key);
		const receive = async (picture) => {
			statistics.add(performance.now(), picture);
			if (next) delay(taken);
			next = picture;
			if (busy) return;
			busy = true;
			while (next) {
				const current = next;
				next = null;
				const bitmap = await decode(current).catch(() => null); // null for a damaged picture
				delay(taken);
				if (this.pictures.get(key) !== watch) bitmap?.close();
				else if (bitmap) decoded(current, bitmap);
			}
			busy = false;
		};
		const watch = { size, statistics, receive };
		this.pictures.set(key, watch);
		this.syncSoon();
		return () => {
			if (this.pictures.get(key) === watch) this.pictures.delete(key);
			if (next) delay(taken);
			next = null;
			this.syncSoon();
		};
	}

	/** Let `receive` have the messages of these streams from now on, and of no others. */
	watchMessages(keys, receive) {
		if (String(this.messages.get(receive) ?? "") === String(keys)) return;
		if (keys.length) this.messages.set(receive, keys);
		else this.messages.delete(receive);
		this.syncSoon();
	}

	/** The pictures a second that arrive, and those of all watched streams: {arriving, all}. */
	rates(now) {
		const sum = (rateOf) => [...this.pictures.values()]
			.reduce((total, { statistics }) => total + (rateOf(statistics) ?? 0), 0);
		return { arriving: sum((one) => one.arrivalRate(now)), all: sum((one) => one.rate(now)) };
	}

	/** Tell whether a stream is not watched because of the limit. */
	isLeftOut(key) {
		return this.sent.size >= MAX_WATCHES && !this.sent.has(key) && this.pictures.has(key);
	}

	/** Send the operations that make the server's watches match the wanted ones. */
	sync() {
		if (!this.connection.isOpen) return;
		const all = new Map();
		for (const key of [...this.messages.values()].flat()) all.set(key, null);
		for (const [key, { size }] of this.pictures) all.set(key, size);
		const wanted = new Map([...all].slice(0, this.hidden ? 0 : MAX_WATCHES));
		for (const key of this.sent.keys()) {
			if (wanted.has(key)) continue;
			this.connection.send({ op: "unwatch", key });
			this.sent.delete(key);
		}
		for (const [key, size] of wanted) {
			const text = JSON.stringify(size);
			if (this.sent.get(key) === text) continue;
			this.connection.send({ op: "watch", key, ...size });
			this.sent.set(key, text);
		}
	}
}

/** Return a picture's bitmap; rejects if its bytes are not a picture. */
export function decode(picture) {
	return createImageBitmap(new Blob([picture.data], { type: picture.mime }), EXACT);
}

/** Free the bitmap of a frame's item: {picture, bitmap}, or a message, which has none. */
export function release(item) {
	item?.bitmap?.close();
}
