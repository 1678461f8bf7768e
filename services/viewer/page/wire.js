// What /live sends, read into plain objects. Knows nothing of sockets or of the document.

const LENGTH_BYTES = 4;

/**
 * Read one binary message: uint32 little-endian length, so many bytes of JSON, the picture.
 * Throws a RangeError or SyntaxError if it is cut short or no JSON.
 */
export function readPicture(buffer) {
	const length = new DataView(buffer).getUint32(0, true);
	const text = new TextDecoder().decode(new Uint8Array(buffer, LENGTH_BYTES, length));
	const { age_ms: ageMs, ...facts } = JSON.parse(text);
	return { ...facts, ageMs, data: new Uint8Array(buffer, LENGTH_BYTES + length) };
}

/** Nanoseconds since 1970, a decimal string, as milliseconds since 1970; null stays null. */
export function milliseconds(nanoseconds) {
	// A double holds milliseconds of our time to less than a microsecond, but not nanoseconds.
	if (nanoseconds === null || nanoseconds === undefined) return null;
	const whole = BigInt(nanoseconds);
	return Number(whole / 1_000_000n) + Number(whole % 1_000_000n) / 1e6;
}

/** Milliseconds from one stamp to another; both decimal strings of nanoseconds. */
export function between(earlier, later) {
	return Number(BigInt(later) - BigInt(earlier)) / 1e6;
}
