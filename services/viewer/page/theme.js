// Dark or light: as the system has it, until the user chooses.

import { byId, say } from "./elements.js";
import { recall, remember } from "./preferences.js";

const prefersLight = matchMedia("(prefers-color-scheme: light)");
prefersLight.addEventListener("change", applyTheme);

export function applyTheme() {
	const theme = recall("theme", prefersLight.matches ? "light" : "dark");
	document.documentElement.dataset.theme = theme;
	say(byId("theme"), theme === "light" ? "Dark" : "Light");
}

export function nextTheme() {
	remember("theme", document.documentElement.dataset.theme === "light" ? "dark" : "light");
	applyTheme();
}
