// The keys, each with what it does: one table for the keyboard and for the help.

import { byId, element } from "./elements.js";
import { closeMenus } from "./choices.js";

const PAN_PX = 60;

/** Return the table: [{title, keys: [{keys, shown, words, act}]}]. */
function table({ wall, large, panels, go, theme, help }) {
  const inLarge = (act) => () => large.isOpen && (act(), true);
  const arrows = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const move = (event) => {
    if (!large.isOpen) return wall.move(event.key);
    const [x, y] = arrows[event.key];
    large.pan(x * PAN_PX, y * PAN_PX);
    return true;
  };
  const panel = (name) => () => (panels.toggle(name), true);
  return [
    { title: "Everywhere", keys: [
      { keys: ["?"], words: "these keys", act: () => (help(), true) },
      { keys: ["w"], words: "all streams", act: () => (go([]), true) },
      { keys: ["/"], words: "filter the streams", act: () => (go([]), byId("filter").focus(), true) },
      { keys: ["e"], words: "parameters", act: panel("parameters") },
      { keys: ["p"], words: "plots", act: panel("plots") },
      { keys: ["g"], words: "graph of nodes and keys", act: panel("graph") },
      { keys: ["h"], words: "health", act: panel("health") },
      { keys: ["l"], words: "log", act: panel("log") },
      { keys: ["m"], words: "panel wide or narrow", act: () => (panels.widen(), true) },
      { keys: ["d"], words: "dark, light, as the system", act: () => (theme(), true) },
      { keys: ["Escape"], shown: "Esc", words: "close the menu, the panel, the large view" },
    ] },
    { title: "On the wall", keys: [
      { keys: Object.keys(arrows), shown: "← ↑ → ↓", words: "from stream to stream", act: move },
      { keys: [], shown: "Enter", words: "show the stream large" },
    ] },
    { title: "With one stream large", keys: [
      { keys: [" "], shown: "Space", words: "pause, go on", act: inLarge(() => large.togglePause()) },
      { keys: [","], words: "one frame back", act: inLarge(() => large.step(-1)) },
      { keys: ["."], words: "one frame on", act: inLarge(() => large.step(1)) },
      { keys: ["+", "="], shown: "+", words: "zoom in", act: inLarge(() => large.zoom(1.25)) },
      { keys: ["-"], words: "zoom out", act: inLarge(() => large.zoom(0.8)) },
      { keys: ["0"], words: "whole frame", act: inLarge(() => large.fit()) },
      { keys: ["1"], words: "one to one", act: inLarge(() => large.actual()) },
      { keys: [], shown: "← ↑ → ↓", words: "move the picture" },
      { keys: ["n"], words: "next stream", act: inLarge(() => large.neighbour(1)) },
      { keys: ["b"], words: "stream before", act: inLarge(() => large.neighbour(-1)) },
      { keys: ["o"], words: "overlay on or off", act: inLarge(() => large.toggleOverlay()) },
      { keys: ["f"], words: "full screen", act: inLarge(() => large.fullScreen()) },
      { keys: ["s"], words: "save the picture as it came", act: inLarge(() => large.save()) },
      { keys: ["S"], shown: "Shift S", words: "save with the overlay, PNG",
        act: inLarge(() => large.saveDrawn()) },
    ] },
  ];
}

/** Listen to the keyboard; `parts` are what the keys act on. */
export function listenToKeyboard(parts) {
  const help = byId("help");
  const groups = table({ ...parts, help: () => (help.open ? help.close() : help.showModal()) });
  const acts = new Map(groups.flatMap((group) => group.keys)
    .flatMap((row) => row.keys.map((key) => [key, row.act])).filter(([, act]) => act));
  byId("help-keys").replaceChildren(...groups.map(helpOf));
  byId("help-button").addEventListener("click", () => help.showModal());
  help.addEventListener("click", (event) => event.target === help && help.close());

  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (event.key === "Escape") {
      if (!help.open) escape(parts);
      return;
    }
    if (help.open && event.key !== "?") return;
    if (isTyping(event)) return;
    if (acts.get(event.key)?.(event)) event.preventDefault();
  });
}

function escape({ large, panels, go }) {
  if (closeMenus() || document.fullscreenElement) return;
  if (panels.open && byId("dock").contains(document.activeElement)) panels.show("");
  else if (large.isOpen) go([]);
  else if (panels.open) panels.show("");
}

/** Tell whether a key belongs to the control that has the focus. */
function isTyping({ target, key }) {
  if (target.closest("select, textarea, input:not([type=checkbox], [type=range])")) return true;
  const usesArrows = target.closest("input[type=range], select, #log-lines");
  if (usesArrows && (key.startsWith("Arrow") || key === " ")) return true;
  return key === " " && Boolean(target.closest("button, summary, input, a"));
}

function helpOf({ title, keys }) {
  return element("section", {}, element("h3", {}, title), element("dl", {},
    ...keys.flatMap((row) => [
      element("dt", {}, ...(row.shown ?? row.keys[0]).split(" ")
        .map((key) => element("kbd", {}, key))),
      element("dd", {}, row.words)])));
}
