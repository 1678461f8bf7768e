// Places each menu below the button that opens it, which CSS alone cannot do in all browsers.

const GAP_PX = 4;
const EDGE_PX = 6;
const WIDEST_PX = 360;

export function placeMenus() {
	for (const menu of document.querySelectorAll("[popover]")) {
		menu.addEventListener("beforetoggle", ({ newState }) => newState === "open" && follow(menu));
	}
}

/** Keep an open menu at its button, which moves when the window or what is above it changes. */
function follow(menu) {
	place(menu);
	requestAnimationFrame(() => menu.matches(":popover-open") && follow(menu));
}

/** Put the upper right corner of a menu below that of its button, so that it stays in the window. */
function place(menu) {
	const buttons = [...document.querySelectorAll(`[popovertarget="${menu.id}"]`)];
	const button = buttons.find((one) => one.checkVisibility()) ?? buttons[0];
	if (!button) return;
	const { bottom, right } = button.getBoundingClientRect();
	const fromRight = Math.min(innerWidth - right, innerWidth - WIDEST_PX - EDGE_PX);
	menu.style.setProperty("--menu-top", `${bottom + GAP_PX}px`);
	menu.style.setProperty("--menu-right", `${Math.max(EDGE_PX, fromRight)}px`);
}
