// Frames as files. What is saved is the picture as it came, with its header in the file; or, with
// the overlay, a PNG of the whole frame with the header and the messages in it.

import { element } from "./elements.js";
import { withHeader } from "./embedding.js";
import { drawOverlay } from "./overlay.js";

const REVOKE_MS = 30_000;
const ENDINGS = { "image/png": "png", "image/jpeg": "jpg" };

/** Save the picture of one stream of a frame, untouched but for the header in it. */
export function saveOriginal(frame, stream) {
	const { picture } = frame.items.get(stream.key);
	const bytes = withHeader(picture.data, picture.mime, { key: stream.key, ...picture.header });
	offer(bytes, picture.mime, fileName(stream.key, picture.header, ENDINGS[picture.mime] ?? "bin"));
}

/** Save a frame as a PNG of its full size, drawn on or not, with its messages in it. */
export async function saveDrawn(frame, stream, overlay) {
	const { picture, bitmap } = frame.items.get(stream.key);
	const { width, height } = picture.header;
	const canvas = new OffscreenCanvas(width, height);
	const context = canvas.getContext("2d");
	context.drawImage(bitmap, 0, 0, width, height);
	const view = { scale: 1, x: width / 2, y: height / 2 };
	drawOverlay(context, frame, overlay.keys, overlay.trails, view, canvas, 1);
	const blob = await canvas.convertToBlob({ type: "image/png" });
	const messages = Object.fromEntries(
		overlay.keys.filter((key) => frame.items.has(key)).map((key) => [key, frame.items.get(key)]),
	);
	const facts = { key: stream.key, ...picture.header, messages };
	const bytes = withHeader(new Uint8Array(await blob.arrayBuffer()), "image/png", facts);
	offer(bytes, "image/png", fileName(stream.key, picture.header, "drawn.png"));
}

export function saveText(text, name) {
	offer(text, "text/plain", name);
}

function fileName(key, header, ending) {
	return `${key.replaceAll("/", "_")}_${header.epoch}_${header.seq}.${ending}`;
}

function offer(content, type, name) {
	const address = URL.createObjectURL(new Blob([content], { type }));
	const link = element("a", { href: address, download: name, hidden: true });
	document.body.append(link);
	link.click();
	link.remove();
	setTimeout(() => URL.revokeObjectURL(address), REVOKE_MS);
}
