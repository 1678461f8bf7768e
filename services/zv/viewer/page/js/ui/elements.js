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
		else if (value !== false && value !== null && value !== undefined) {
			made.setAttribute(name, value);
		}
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

/** Call a listener at each event of an element of the page. */
export function listen(id, type, listener) {
	byId(id).addEventListener(type, listener);
}

/** Return a function that calls `run` once, `ms` after the first of its own calls. */
export function later(run, ms) {
	let isDue = false;
	return () => {
		if (isDue) return;
		isDue = true;
		setTimeout(() => {
			isDue = false;
			run();
		}, ms);
	};
}

/**
 * Make a list show one view for each of `items`, in that order; views in place are not touched.
 * Items are keys or have a `key`. `views` maps keys to objects with an `element`: `make(item)` adds
 * those that are missing, `close(view)` is called for those that are removed.
 */
export function syncViews(list, views, items, make, close = (_view) => {}) {
	const keys = items.map((item) => item.key ?? item);
	const wanted = new Set(keys);
	for (const [key, view] of views) {
		if (wanted.has(key)) continue;
		views.delete(key);
		view.element.remove();
		close(view);
	}
	keys.forEach((key, index) => {
		if (!views.has(key)) views.set(key, make(items[index]));
		const { element: shown } = views.get(key);
		const present = list.children[index];
		if (present !== shown) list.insertBefore(shown, present ?? null);
	});
}

/** Replace the rows of a list; the control that has the focus keeps it, by its `data-choice`. */
export function replaceRows(list, rows) {
	const { activeElement: active } = document;
	const focused = list.contains(active) && active?.dataset.choice;
	list.replaceChildren(...rows.filter(Boolean));
	if (focused) list.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus();
}

/** A labelled checkbox; `chosen(on)` is called when it is changed. */
export function checkbox(label, checked, chosen, attributes = {}) {
	const { title, ...others } = attributes;
	return element("label", { title }, element("input", { type: "checkbox", checked,
		"data-choice": label, onchange: ({ target }) => chosen(target.checked), ...others }),
	element("span", {}, label));
}

export function option(value, text) {
	return element("option", { value }, text);
}

/** Offer [value, text] in a list, which keeps its choice; it is touched only if they differ. */
export function setOptions(list, options) {
	const made = JSON.stringify(options);
	if (list.made === made) return;
	const { value } = list;
	list.made = made;
	list.replaceChildren(...options.map(([each, text]) => option(each, text)));
	if (options.some(([each]) => String(each) === value)) list.value = value;
}
