// Makes the image that a pane draws of a picture: the picture itself, or a copy whose values were
// stretched or coloured.

import { automaticRange, histogramOf, paintTone, valuesOf } from "../video/tone.js";

export class Toner {
	constructor() {
		this.context = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
		this.item = null;
		this.asked = "";
		/** @type {any} */
		this.made = null;
	}

	/**
	 * Return {image, values, isPlain, range: {low, high}, histogram} of an item {picture, bitmap}, made
	 * once for each item and choice; `histogram` is null unless it `isMeasured` or needed. `choice` is
	 * {range, low, high, map}, where `range` is "sent", "auto" or "fixed".
	 */
	toned(item, choice, isMeasured) {
		const asked = JSON.stringify([choice, isMeasured]);
		if (item !== this.item || asked !== this.asked) this.made = this.make(item, choice, isMeasured);
		this.item = item;
		this.asked = asked;
		return this.made;
	}

	make({ picture, bitmap }, choice, isMeasured) {
		const values = valuesOf(picture);
		const isPlain = choice.range === "sent" && !(values.isGrey && choice.map !== "grey")
			&& !(values.isDepth && values.isExact);
		const sent = { low: values.low, high: values.high };
		if (isPlain && !isMeasured) return { image: bitmap, values, isPlain, range: sent, histogram: null };
		const pixels = this.read(bitmap);
		const isAutomatic = choice.range === "auto";
		const histogram = isMeasured || isAutomatic ? histogramOf(pixels.data, values) : null;
		const range = isAutomatic && histogram ? automaticRange(histogram)
			: choice.range === "fixed" ? { low: choice.low, high: choice.high } : sent;
		if (isPlain) return { image: bitmap, values, isPlain, range, histogram };
		paintTone(pixels.data, values, { ...range, map: choice.map });
		this.context.putImageData(pixels, 0, 0);
		return { image: this.context.canvas, values, isPlain, range, histogram };
	}

	/** Return the pixels of a bitmap, which then are also in the canvas. */
	read(bitmap) {
		const { canvas } = this.context;
		const { width, height } = bitmap;
		if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
		this.context.drawImage(bitmap, 0, 0);
		return this.context.getImageData(0, 0, width, height);
	}
}
