// Pictures to bitmaps: one at a time a stream, the newest next, none queued behind it.

const EXACT = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

/** Return a picture's bitmap; rejects if its bytes are no picture. */
export function decode(picture) {
	return createImageBitmap(new Blob([picture.data], { type: picture.mime }), EXACT);
}

export class NewestDecoder {
	/** `decoded(picture, bitmap)` owns the bitmap; `failed(picture, error)`. */
	constructor(decoded, failed = () => {}) {
		this.decoded = decoded;
		this.failed = failed;
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
			try {
				const bitmap = await decode(picture);
				if (this.closed) bitmap.close();
				else this.decoded(picture, bitmap);
			} catch (error) {
				this.failed(picture, error);
			}
			taken();
		}
		this.busy = false;
	}
}
