// A frame's header inside its picture's file: a tEXt chunk in a PNG, a comment in a JPEG.
// The picture itself stays as it was, byte for byte. Arrays of bytes in and out.

export const KEYWORD = "vision.Header";
const PNG_SIGNATURE_AND_IHDR = 8 + 25;
const JPEG_COMMENT = 0xfe;
const JPEG_LONGEST = 65_533;

/** Return the file with the header in it; `facts` is any JSON object. */
export function withHeader(bytes, mime, facts) {
	const text = escaped(JSON.stringify(facts));
	return mime === "image/png" ? pngWith(bytes, text) : jpegWith(bytes, text);
}

function pngWith(bytes, text) {
	const body = latin1(`tEXt${KEYWORD}\0${text}`);
	const chunk = new Uint8Array(body.length + 8);
	const view = new DataView(chunk.buffer);
	view.setUint32(0, body.length - 4);
	chunk.set(body, 4);
	view.setUint32(body.length + 4, crc32(body));
	return inserted(bytes, PNG_SIGNATURE_AND_IHDR, chunk);
}

function jpegWith(bytes, text) {
	const body = latin1(`${KEYWORD} ${text}`).subarray(0, JPEG_LONGEST);
	const segment = new Uint8Array(body.length + 4);
	const view = new DataView(segment.buffer);
	view.setUint16(0, 0xff00 | JPEG_COMMENT);
	view.setUint16(2, body.length + 2);
	segment.set(body, 4);
	return inserted(bytes, afterApplicationSegments(bytes), segment);
}

/** Return where the first segment begins that is no APPn: some readers want those first. */
function afterApplicationSegments(bytes) {
	let at = 2;
	while (bytes[at] === 0xff && bytes[at + 1] >= 0xe0 && bytes[at + 1] <= 0xef) {
		at += 2 + bytes[at + 2] * 256 + bytes[at + 3];
	}
	return at;
}

function inserted(bytes, at, part) {
	const whole = new Uint8Array(bytes.length + part.length);
	whole.set(bytes.subarray(0, at));
	whole.set(part, at);
	whole.set(bytes.subarray(at), at + part.length);
	return whole;
}

/** JSON in ASCII: what is not is written as \uXXXX. */
function escaped(json) {
	return json.replace(/[\u007f-\uffff]/g, (letter) =>
		`\\u${letter.charCodeAt(0).toString(16).padStart(4, "0")}`);
}

function latin1(text) {
	return Uint8Array.from(text, (letter) => letter.charCodeAt(0));
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, index) => {
	let value = index;
	for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? 0xedb88320 ^ (value >>> 1) : value >>> 1;
	return value;
});

/** CRC-32 as PNG has it (ISO 3309). */
export function crc32(bytes) {
	let crc = 0xffffffff;
	for (const byte of bytes) crc = CRC_TABLE[(crc ^ byte) & 0xff] ^ (crc >>> 8);
	return (crc ^ 0xffffffff) >>> 0;
}
