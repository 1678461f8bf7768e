// Saves frames as files that contain the frame's header: the picture as received, byte for byte, or
// a PNG of the whole frame with the overlay, which also contains the messages. The header is a tEXt
// chunk in a PNG, a comment in a JPEG. A depth picture is saved as a PNG of its 16 bits.

import { element } from "../ui/elements.js";
import { drawOverlay } from "../video/overlay.js";
import { chunk, depthPng } from "./png.js";

export const KEYWORD = "vision.Header";
const REVOKE_MS = 30_000;
const PNG_SIGNATURE_AND_IHDR = 8 + 25;
const JPEG_COMMENT = Uint8Array.of(0xff, 0xfe);
const JPEG_LONGEST = 65_533;

/** Save the picture of one stream of a frame, unchanged except for the added header. */
export async function saveOriginal(frame, { key }) {
	const { picture, bitmap } = frame.items.get(key);
	const { header, mime } = picture;
	const ending = mime === "image/png" ? "png" : "jpg";
	const data = picture.depth?.values ? await depthPng(pixelsOf(bitmap)) : picture.data;
	offer(withHeader(data, mime, { key, ...header }), mime, fileName(key, header, ending));
}

/**
 * Save a frame as a PNG of its full size: `image`, the picture of the stream as it is shown, with
 * the overlay {keys, trails} drawn on it.
 */
export async function saveDrawn(frame, { key }, overlay, image) {
	const { picture: { header } } = frame.items.get(key);
	const canvas = new OffscreenCanvas(header.width, header.height);
	const context = canvas.getContext("2d");
	context.drawImage(image, 0, 0, canvas.width, canvas.height);
	drawOverlay(context, frame, overlay, (point) => point);
	const blob = await canvas.convertToBlob({ type: "image/png" });
	const drawn = [...frame.items].filter(([one]) => overlay.keys.includes(one));
	const bytes = new Uint8Array(await blob.arrayBuffer());
	const fields = { key, ...header, messages: Object.fromEntries(drawn) };
	offer(withHeader(bytes, "image/png", fields), "image/png", fileName(key, header, "drawn.png"));
}

function pixelsOf(bitmap) {
	const { width, height } = bitmap;
	const context = new OffscreenCanvas(width, height).getContext("2d");
	context.drawImage(bitmap, 0, 0);
	return context.getImageData(0, 0, width, height);
}

function fileName(key, header, ending) {
	return `${key.replaceAll("/", "_")}_${header.epoch}_${header.seq}.${ending}`;
}

/** Offer the parts of a file as a download. */
export function offer(parts, type, name) {
	const address = URL.createObjectURL(new Blob(parts, { type }));
	element("a", { href: address, download: name }).click();
	setTimeout(() => URL.revokeObjectURL(address), REVOKE_MS);
}

/** Return the parts of a picture's file with `fields`, any JSON object, added. */
export function withHeader(bytes, mime, fields) {
	const json = JSON.stringify(fields).replace(/[\u007f-\uffff]/g, (letter) =>
		`\\u${letter.charCodeAt(0).toString(16).padStart(4, "0")}`);
	if (mime === "image/png") {
		const text = chunk("tEXt", new TextEncoder().encode(`${KEYWORD}\0${json}`));
		return [bytes.subarray(0, PNG_SIGNATURE_AND_IHDR), text, bytes.subarray(PNG_SIGNATURE_AND_IHDR)];
	}
	const comment = new TextEncoder().encode(`${KEYWORD} ${json}`).subarray(0, JPEG_LONGEST);
	// Before the first segment other than APPn: some readers require those first.
	let at = 2;
	while (bytes[at] === 0xff && bytes[at + 1] >= 0xe0 && bytes[at + 1] <= 0xef) {
		at += 2 + bytes[at + 2] * 256 + bytes[at + 3];
	}
	const length = comment.length + 2;
	return [bytes.subarray(0, at), JPEG_COMMENT, Uint8Array.of(length >> 8, length & 255), comment,
		bytes.subarray(at)];
}
