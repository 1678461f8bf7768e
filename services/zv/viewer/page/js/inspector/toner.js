// Makes the image that a pane draws of a picture: the picture itself, or a copy whose values were
// stretched or coloured.

import { resize } from "../ui/elements.js";
import { automaticRange, histogramOf, paintTone, valuesOf } from "../video/tone.js";

export class Toner {
	context = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
	item = null;
	asked = "";
	/** @type {any} */
	made = null;

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

	make({ picture, bitmap }, { range, low, high, map }, isMeasured) {
		const values = valuesOf(picture);
		const isPlain = range === "sent" && !(values.isGrey && map !== "grey")
			&& !(values.isDepth && values.isExact);
		/** @type {any} */
		const made = { image: bitmap, values, isPlain, range: values, histogram: null };
		if (isPlain && !isMeasured) return made;
		const { context } = this;
		resize(context.canvas, bitmap);
		context.drawImage(bitmap, 0, 0);
		const pixels = context.getImageData(0, 0, bitmap.width, bitmap.height);
		if (isMeasured || range === "auto") made.histogram = histogramOf(pixels.data, values);
		if (range === "auto") made.range = automaticRange(made.histogram);
		if (range === "fixed") made.range = { low, high };
		if (isPlain) return made;
		paintTone(pixels.data, values, { ...made.range, map });
		context.putImageData(pixels, 0, 0);
		return { ...made, image: context.canvas };
	}
}
