// The parts of a PNG, and one of 16 bits with the values of a depth picture: a canvas has only 8.

const SIGNATURE = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
const GREY_OF_16_BITS = [16, 0, 0, 0, 0]; // bits, grey, and three methods of which there is one each

/** Return a PNG of the values in RGBA pixels: the high byte is red, the low byte is green. */
export async function depthPng({ data, width, height }) {
	const rows = new Uint8Array(height * (1 + 2 * width)); // each begins with its filter: 0, none
	for (let pixel = 0; pixel < width * height; pixel += 1) {
		const row = Math.floor(pixel / width);
		rows.set(data.subarray(4 * pixel, 4 * pixel + 2), 2 * pixel + row + 1);
	}
	const packed = new Blob([rows]).stream().pipeThrough(new CompressionStream("deflate"));
	const bytes = new Uint8Array(await new Response(packed).arrayBuffer());
	const about = joined(bigEndian(width, 4), bigEndian(height, 4), GREY_OF_16_BITS);
	return joined(SIGNATURE, chunk("IHDR", about), chunk("IDAT", bytes), chunk("IEND", []));
}

/** A chunk of a PNG. */
export function chunk(name, content) {
	const typed = joined(new TextEncoder().encode(name), content);
	return joined(bigEndian(content.length, 4), typed, bigEndian(crc32(typed), 4));
}

function joined(...parts) {
	const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
	let at = 0;
	for (const part of parts) {
		all.set(part, at);
		at += part.length;
	}
	return all;
}

function bigEndian(value, size) {
	return Uint8Array.from({ length: size }, (_, index) => value >>> (8 * (size - 1 - index)));
}

/** The CRC-32 of PNG (ISO 3309). */
export function crc32(bytes) {
	let crc = 0xffffffff;
	for (const byte of bytes) {
		crc ^= byte;
		for (let bit = 0; bit < 8; bit += 1) crc = crc & 1 ? 0xedb88320 ^ (crc >>> 1) : crc >>> 1;
	}
	return (crc ^ 0xffffffff) >>> 0;
}
