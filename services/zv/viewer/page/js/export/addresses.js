// Addresses of a stream for other pages and programs. They never contain a token: a browser that
// has opened this page has a session, and others need a token from the user.

import { setText } from "../ui/elements.js";

const COPIED_MS = 1500;

/** The URL of the page's folder, without its last "/": a proxy may serve it below a path. */
export function pageFolder() {
	return new URL(".", location.href).href.slice(0, -1);
}

/**
 * The URL of a stream's pictures, or with `path` "snapshot" of its newest one, at `folder`. `choice` is {width,
 * quality}, each null for "as sent"; `raw` tells that the key is that of raw pixels.
 */
export function streamAddress(folder, key, { width, quality }, raw = false, path = "stream") {
	const given = [["topic", `/${key}`], ["width", width], ["quality", quality],
		["default_transport", raw ? "raw" : null]].filter(([, value]) => value !== null);
	const query = given.map(([name, value]) =>
		`${name}=${encodeURIComponent(value).replaceAll("%2F", "/")}`);
	return `${folder}/${path}?${query.join("&")}`;
}

/** Make a button copy a text field. */
export function copies(button, field) {
	button.addEventListener("click", () => copyText(button, field));
}

/**
 * Copy a text field and say so on a button; where the browser forbids it, the text is selected.
 * Resolves to whether it was copied.
 */
export async function copyText(button, field, label = "Copy") {
	field.focus();
	field.select();
	// A page without HTTPS from another machine may not copy.
	const copying = navigator.clipboard?.writeText(field.value) ?? Promise.reject();
	const isCopied = await copying.then(() => true, () => false);
	setText(button, isCopied ? "Copied" : "Ctrl-C");
	setTimeout(() => setText(button, label), COPIED_MS);
	return isCopied;
}
