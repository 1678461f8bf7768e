// Pictures to bitmaps: one at a time a stream, the newest next, none queued behind it.

const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

/** Return a picture's bitmap; rejects if its bytes are no picture. */
export function decode(picture) {
	return createImageBitmap(new Blob([picture.data], { type: picture.mime }), EXACT);
}

export class NewestDecoder {
	/** `decoded(picture, bitmap)` owns the bitmap. */
	constructor(decoded) {
		this.decoded = decoded;
		this.busy = false;
		this.next = null;
		this.closed = false;
	}

	/** Decode a picture soon, unless a newer one comes first; `taken` is called once either way. */
	offer(picture, taken) {
		this.next?.taken();
		this.next = { picture, taken };
		if (!this.busy) this.work();
	}

	close() {
		this.closed = true;
		this.next?.taken();
		this.next = null;
	}

	async work() {
		this.busy = true;
		while (this.next) {
			const { picture, taken } = this.next;
			this.next = null;
			const bitmap = await decode(picture).catch(() => null); // a broken one is no picture
			taken();
			if (this.closed) bitmap?.close();
			else if (bitmap) this.decoded(picture, bitmap);
		}
		this.busy = false;
	}
}
