// How the values of a picture become colours on the screen: the range that is stretched from black
// to white, colour maps, and the histogram. The values are those of the 8 bits of each channel, or
// of a picture of 16 bits (depth), which the server sends with the high byte as red, the low byte as
// green, and the grey of its own rendering as blue.

import { resize } from "../ui/elements.js";

const BINS = 256;
const SAMPLES = 65_536; // of a picture, for its histogram
const LOWEST_SHARE = 0.01;
const GREY = /^(mono|8UC1|16UC1|32FC1)/;
const MILLIMETRES = ["16UC1", "32FC1"];

// Colours at equal distances, from the lowest value to the highest.
const MAPS = {
	grey: ["#000000", "#ffffff"],
	viridis: ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"],
	heat: ["#000000", "#8b0000", "#ff4500", "#ffd700", "#ffffff"],
	rainbow: ["#2000a0", "#0060ff", "#00d0d0", "#40e000", "#f0e000", "#ff6000", "#a00000"],
};
export const MAP_NAMES = Object.keys(MAPS);

/**
 * What the values of a picture are: {isGrey, isDepth, isExact, unit, low, high}, where low and high
 * are the range in which it was sent, and `of(red, green, blue)` is the value of a pixel, NaN where
 * a depth camera has no reading.
 */
export function valuesOf({ header, depth }) {
	if (!depth) {
		const isGrey = GREY.test(header.encoding);
		const of = isGrey ? (red) => red
			: (red, green, blue) => 0.299 * red + 0.587 * green + 0.114 * blue;
		return { isGrey, isDepth: false, isExact: true, unit: "", low: 0, high: 255, of };
	}
	const { min: low, max: high, values: isExact } = depth;
	const unit = MILLIMETRES.includes(header.encoding) ? "mm" : "";
	const of = isExact ? (red, green) => red * 256 + green || NaN
		: (level) => (level ? low + (level - 1) * (high - low) / 254 : NaN);
	return { isGrey: true, isDepth: true, isExact, unit, low, high, of };
}

/**
 * Count the values of RGBA pixels: {counts, low, high, total}. `counts` has 256 bins from `low` to
 * `high`: 0 to 255 of a picture of 8 bits, the lowest and highest reading of one of 16.
 */
export function histogramOf(pixels, values) {
	const step = 4 * Math.max(1, Math.floor(pixels.length / 4 / SAMPLES) | 1); // odd: not a column
	const found = [];
	for (let at = 0; at < pixels.length; at += step) {
		const value = values.of(pixels[at], pixels[at + 1], pixels[at + 2]);
		if (!Number.isNaN(value)) found.push(value);
	}
	const least = (best, value) => Math.min(best, value);
	const most = (best, value) => Math.max(best, value);
	const low = values.isDepth ? found.reduce(least, Infinity) : 0;
	const high = values.isDepth ? found.reduce(most, -Infinity) : 255;
	const counts = new Uint32Array(BINS);
	const scale = (BINS - 1) / Math.max(1, high - low);
	for (const value of found) counts[Math.round((value - low) * scale)] += 1;
	return { counts, low: found.length ? low : 0, high: found.length ? high : 0, total: found.length };
}

/** The range of a histogram without its lowest and highest percent: {low, high}. */
export function automaticRange({ counts, low, high, total }) {
	const place = (wanted) => {
		let sum = 0;
		const bin = counts.findIndex((number) => (sum += number) >= wanted);
		return low + Math.max(0, bin) * (high - low) / (BINS - 1);
	};
	const [from, to] = [place(LOWEST_SHARE * total || 1), place((1 - LOWEST_SHARE) * total)];
	return { low: from, high: Math.max(to, from + 1) };
}

/** The 256 colours of a map as bytes: red, green, blue of each. */
function coloursOf(name) {
	const stops = (MAPS[name] ?? MAPS.grey).map((text) =>
		[1, 3, 5].map((at) => Number.parseInt(text.slice(at, at + 2), 16)));
	return Uint8ClampedArray.from({ length: 3 * 256 }, (_, at) => {
		const place = Math.floor(at / 3) / 255 * (stops.length - 1);
		const before = Math.min(Math.floor(place), stops.length - 2);
		const [from, to] = [stops[before][at % 3], stops[before + 1][at % 3]];
		return from + (to - from) * (place - before);
	});
}

/** The gradient of a map for a style. */
export function gradientOf(name) {
	return `linear-gradient(to right, ${(MAPS[name] ?? MAPS.grey).join(", ")})`;
}

/**
 * Change RGBA pixels to what is shown: values from `low` to `high` become black to white, or the
 * colours of `map` if the picture is grey. Pixels without a reading become black.
 */
export function paintTone(pixels, values, { low, high, map }) {
	const span = Math.max(1e-9, high - low);
	if (!values.isGrey) {
		const levels = Uint8ClampedArray.from({ length: 256 }, (_, value) => (value - low) * 255 / span);
		for (let at = 0; at < pixels.length; at += 4) {
			for (let part = at; part < at + 3; part += 1) pixels[part] = levels[pixels[part]];
		}
		return;
	}
	const colours = coloursOf(map);
	for (let at = 0; at < pixels.length; at += 4) {
		const value = values.of(pixels[at], pixels[at + 1], pixels[at + 2]);
		const level = Math.round(Math.min(255, Math.max(0, (value - low) * 255 / span)));
		for (let part = 0; part < 3; part += 1) {
			pixels[at + part] = Number.isNaN(value) ? 0 : colours[3 * level + part];
		}
	}
}

/** A value with its unit: "2.345 m", "810 mm", "17"; "no reading" for NaN. */
export function valueText(value, unit) {
	if (Number.isNaN(value)) return "no reading";
	if (unit !== "mm") return String(Math.round(value));
	return value >= 1000 ? `${(value / 1000).toFixed(3)} m` : `${Math.round(value)} mm`;
}

/**
 * Makes the image that a pane draws of a picture: the picture itself, or a copy whose values were
 * stretched or coloured.
 */
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
