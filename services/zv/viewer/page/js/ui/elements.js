// Creates and changes elements. Text is always set as text, so that nothing from the network
// becomes markup.

const SVG = "http://www.w3.org/2000/svg";

/** Make an HTML element: `element("a", {href: "#", class: "back", onclick: f}, "Wall")`. */
export function element(tag, attributes = {}, ...children) {
	return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
	return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill(made, attributes, children) {
	for (const [name, value] of Object.entries(attributes)) {
		if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
		else if (value === true) made.setAttribute(name, "");
		else if ((value ?? false) !== false) made.setAttribute(name, value);
	}
	made.append(...children.flat().filter((child) => child ?? false));
	return made;
}

/** Set an element's text, but touch the document only if it differs. */
export function setText(target, text) {
	if (target.textContent !== text) target.textContent = text;
}

/** Set data attributes, but touch the document only where one differs. */
export function setData(target, values) {
	for (const [name, value] of Object.entries(values)) {
		if (target.dataset[name] !== String(value)) target.dataset[name] = value;
	}
}

/**
 * Return an element of the page, whatever kind it is.
 * @returns {any}
 */
export function byId(id) {
	return document.getElementById(id);
}

/** Make a canvas this large, which also clears it, if it is not. */
export function resize(canvas, { width, height }) {
	if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

/** Call a listener at each event of an element of the page. */
export function listen(id, type, listener) {
	byId(id).addEventListener(type, listener);
}

/** Return a function that calls `run` once, `ms` after the first of its own calls. */
export function later(run, ms) {
	let timer = null;
	return () => {
		if (timer) return;
		timer = setTimeout(() => {
			timer = null;
			run();
		}, ms);
	};
}

const VIEWS = new WeakMap(); // list -> its views by their keys

/**
 * Make a list show one view for each of `items`, in that order; views in place are not touched, and
 * the focus stays where it is. Items are keys or have a `key`. `make(item)` makes a view, an object
 * with an `element`, and perhaps `update(item)`, which is called at each drawing; `close(view)` is
 * called for one that is removed. Returns the views by their keys.
 */
export function drawList(list, items, make, close = (_view) => {}) {
	const before = VIEWS.get(list) ?? new Map();
	const keyOf = (item) => item.key ?? item;
	const views = new Map(items.map((item) => [keyOf(item), before.get(keyOf(item)) ?? make(item)]));
	VIEWS.set(list, views);
	for (const [key, view] of before) {
		if (views.has(key)) continue;
		view.element.remove();
		close(view);
	}
	/** @type {any} */
	const active = document.activeElement;
	[...views.values()].forEach(({ element: shown }, index) => {
		const present = list.children[index];
		if (present !== shown) list.insertBefore(shown, present ?? null);
	});
	if (list.contains(active) && active !== document.activeElement) active.focus();
	for (const item of items) views.get(keyOf(item)).update?.(item);
	return views;
}

/** A view of a labelled checkbox: `isOn(item)` says whether it is on, `choose(on)` is called by it. */
export function checkboxView(label, isOn, choose) {
	const box = element("input", { type: "checkbox", onchange: () => choose(box.checked) });
	return {
		element: element("label", {}, box, element("span", {}, label)),
		update: (item) => Object.assign(box, { checked: isOn(item) }),
	};
}

/** Offer [value, text] in a list, which keeps its choice; it is touched only if they differ. */
export function setOptions(list, options) {
	const made = JSON.stringify(options);
	if (list.made === made) return;
	const { value } = list;
	list.made = made;
	list.replaceChildren(...options.map(([each, text]) => new Option(text, each)));
	if (options.some(([each]) => String(each) === value)) list.value = value;
}
