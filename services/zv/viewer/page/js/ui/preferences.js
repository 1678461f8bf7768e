// Stores the user's preferences in the browser, and applies the theme, which is the system's until
// the user chooses one.

import { byId, listen, setText } from "./elements.js";

const PREFIX = "zv.";
const MOST_CHOICES = 64;
const PREFERS_LIGHT = "(prefers-color-scheme: light)";

export function loadPreference(name, fallback) {
	try {
		const text = localStorage.getItem(PREFIX + name);
		return text === null ? fallback : JSON.parse(text);
	} catch {
		return fallback;
	}
}

export function savePreference(name, value) {
	try {
		localStorage.setItem(PREFIX + name, JSON.stringify(value));
	} catch {
		// In private windows or on a full disk, the choice is kept until the page is closed.
	}
}

/** Choices by key, kept in the browser; of very many, the newest. */
export class KeptChoices {
	constructor(name) {
		this.name = name;
		this.choices = new Map(Object.entries(loadPreference(name, {}) ?? {}));
	}

	get(key) {
		return this.choices.get(key);
	}

	/** Set the choice for a key; null for none. */
	set(key, choice) {
		this.choices.delete(key); // the newest are last
		if (choice !== null) this.choices.set(key, choice);
		savePreference(this.name, Object.fromEntries([...this.choices].slice(-MOST_CHOICES)));
	}
}

export function startTheme() {
	matchMedia(PREFERS_LIGHT).addEventListener("change", applyTheme);
	listen("theme", "click", () => {
		const { theme } = document.documentElement.dataset;
		savePreference("theme", theme === "light" ? "dark" : "light");
		applyTheme();
	});
	applyTheme();
}

/** A colour of the theme, by its name in the styles. */
export function themeColour(name) {
	return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);
}

function applyTheme() {
	const theme = loadPreference("theme", matchMedia(PREFERS_LIGHT).matches ? "light" : "dark");
	document.documentElement.dataset.theme = theme;
	setText(byId("theme"), theme === "light" ? "Dark" : "Light");
}
