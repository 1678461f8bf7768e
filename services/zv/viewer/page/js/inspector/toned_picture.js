// The picture that a pane draws: the picture itself, or a copy whose values were stretched or
// coloured. The copy is made once for each picture and choice.

import { automaticRange, histogramOf, paintTone, valuesOf } from "../video/tone.js";

export class TonedPicture {
	constructor() {
		this.context = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
		this.reset();
	}

	reset() {
		this.item = null;
		this.made = null;
		this.image = null;
		this.range = null;
		this.histogram = null;
	}

	/**
	 * Prepare `image`, `range` {low, high} and, if it `isMeasured`, `histogram` of an item {picture,
	 * bitmap}. `choice` is {range, low, high, map}, where `range` is "sent", "auto" or "fixed".
	 */
	prepare(item, choice, isMeasured) {
		const made = JSON.stringify([choice, isMeasured]);
		if (item === this.item && made === this.made) return;
		const values = valuesOf(item.picture);
		const isPlain = choice.range === "sent" && !(values.isGrey && choice.map !== "grey")
			&& !(values.isDepth && values.isExact);
		this.item = item;
		this.made = made;
		this.values = values;
		this.isPlain = isPlain;
		this.image = item.bitmap;
		this.histogram = null;
		this.range = { low: values.low, high: values.high };
		if (isPlain && !isMeasured) return;
		const pixels = this.read(item.bitmap);
		const isAutomatic = choice.range === "auto";
		const histogram = isMeasured || isAutomatic ? histogramOf(pixels.data, values) : null;
		this.histogram = histogram;
		if (isAutomatic && histogram) this.range = automaticRange(histogram);
		if (choice.range === "fixed") this.range = { low: choice.low, high: choice.high };
		if (isPlain) return;
		paintTone(pixels.data, values, { ...this.range, map: choice.map });
		this.context.putImageData(pixels, 0, 0);
		this.image = this.context.canvas;
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
