// Addresses of a stream for other pages and programs. They never contain a token: a browser that
// has opened this page has a session, and others need a token from the user.

/**
 * The URL of a stream's pictures, or with `path` "snapshot" of its newest one. `choice` is {width,
 * quality}, each null for "as sent"; `raw` tells that the key is that of raw pixels.
 */
export function streamAddress(origin, key, { width, quality }, raw = false, path = "stream") {
	const given = [["topic", `/${key}`], ["width", width], ["quality", quality],
		["default_transport", raw ? "raw" : null]].filter(([, value]) => value !== null);
	const query = given.map(([name, value]) =>
		`${name}=${encodeURIComponent(value).replaceAll("%2F", "/")}`);
	return `${origin}/${path}?${query.join("&")}`;
}

/** Copy a text field's text; where the browser does not allow that, it is left selected. */
export async function copyText(field) {
	field.focus();
	field.select();
	try {
		await navigator.clipboard.writeText(field.value);
		return true;
	} catch {
		return false; // a page without HTTPS from another machine may not copy
	}
}
