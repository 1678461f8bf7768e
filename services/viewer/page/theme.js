// Dark, light, or as the system has it.

import { byId, say } from "./elements.js";
import { recall, remember } from "./preferences.js";

const THEMES = ["auto", "dark", "light"];
const prefersLight = matchMedia("(prefers-color-scheme: light)");
prefersLight.addEventListener("change", applyTheme);

export function applyTheme() {
  const theme = recall("theme", "auto");
  const system = prefersLight.matches ? "light" : "dark";
  document.documentElement.dataset.theme = theme === "auto" ? system : theme;
  say(byId("theme"), theme[0].toUpperCase() + theme.slice(1));
}

export function nextTheme() {
  remember("theme", THEMES[(THEMES.indexOf(recall("theme", "auto")) + 1) % THEMES.length]);
  applyTheme();
}
