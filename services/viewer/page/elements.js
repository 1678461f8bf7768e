// Elements from code. Text is always set as text, so nothing from the network becomes markup.

const SVG = "http://www.w3.org/2000/svg";

/** Make an HTML element: `element("a", {href: "#", class: "back", onclick: f}, "Wall")`. */
export function element(tag, attributes = {}, ...children) {
	return filled(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
	return filled(document.createElementNS(SVG, tag), attributes, children);
}

function filled(made, attributes, children) {
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

/** Set an element's text, but touch the document only if it is another. */
export function say(target, text) {
	if (target.textContent !== text) target.textContent = text;
}

/** Set a data attribute, but touch the document only if it is another. */
export function mark(target, name, value) {
	const text = String(value);
	if (target.dataset[name] !== text) target.dataset[name] = text;
}

export function byId(id) {
	return document.getElementById(id);
}

/** Put elements into a list in this order; those that stand right are not touched. */
export function inPlace(list, elements) {
	elements.forEach((one, index) => {
		const there = list.children[index];
		if (there !== one) list.insertBefore(one, there ?? null);
	});
}
