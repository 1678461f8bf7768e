// What this browser remembers of the user's choices. Where it may not remember, it forgets.

const PREFIX = "zv.";

export function recall(name, fallback) {
	try {
		const text = localStorage.getItem(PREFIX + name);
		return text === null ? fallback : JSON.parse(text);
	} catch {
		return fallback;
	}
}

export function remember(name, value) {
	try {
		localStorage.setItem(PREFIX + name, JSON.stringify(value));
	} catch {
		// Private windows and full disks: the choice then holds until the page is closed.
	}
}
