// A slider's way from its place to a value and back, and values as a parameter wants them.
//
// Ranges are often far wider than what one uses (0 to 100 000 with a default of 40). Such a slider
// is bent, so that the default stands at 40 % of its way and small values can be chosen finely.

export const STEPS = 1000;
const DEFAULT_AT = 0.4;
const MOST_BENT = 12;
const WIDE = 1000;

/** The exponent of a parameter's slider: 1 for a straight one. */
export function bend({ minimum, maximum, default: usual }) {
	const share = typeof usual === "number" ? (usual - minimum) / (maximum - minimum) : 0;
	if (share <= 0 || share >= 1) return maximum - minimum > WIDE ? 3 : 1;
	if (share > 0.1) return 1;
	return Math.min(MOST_BENT, Math.log(share) / Math.log(DEFAULT_AT));
}

export function valueAt(parameter, place) {
	const { minimum, maximum, type } = parameter;
	const value = minimum + (maximum - minimum) * (place / STEPS) ** bend(parameter);
	if (type === "int") return Math.round(value);
	const fine = Number(value.toPrecision(3));
	return Math.min(maximum, Math.max(minimum, fine));
}

export function placeOf(parameter, value) {
	const { minimum, maximum } = parameter;
	if (typeof value !== "number") return 0;
	const share = Math.min(1, Math.max(0, (value - minimum) / (maximum - minimum)));
	return Math.round(STEPS * share ** (1 / bend(parameter)));
}

/** A text from a control as the parameter's type; null for an empty one that may be unset. */
export function typed(parameter, text) {
	if (text === "" && parameter.default === null) return null;
	if (parameter.type === "int" || parameter.type === "float") {
		return text.trim() === "" || Number.isNaN(Number(text)) ? text : Number(text);
	}
	return text;
}
