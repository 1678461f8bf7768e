// Dark, light, or as the system has it.

import { byId, say } from "./elements.js";
import { recall, remember } from "./preferences.js";

const THEMES = ["auto", "dark", "light"];

export function applyTheme() {
  const theme = recall("theme", "auto");
  if (theme === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme;
  say(byId("theme"), { auto: "Auto", dark: "Dark", light: "Light" }[theme] ?? "Auto");
}

export function nextTheme() {
  const at = THEMES.indexOf(recall("theme", "auto"));
  remember("theme", THEMES[(at + 1) % THEMES.length]);
  applyTheme();
}
