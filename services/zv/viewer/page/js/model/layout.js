// The layout in the fragment of the URL: which streams are shown, in which order and size, and
// which parts of the page are hidden. It is validated when it is read, since anybody can write a
// URL.
//
//   #KEY+KEY                    these streams large, the first of which leads; none: the wall
//   ?only=KEY+KEY               the wall shows these streams, in this order
//   &columns=2                  tiles in a row of the wall
//   &width=320&quality=50       largest width of a picture, pixels, and quality of its JPEG
//   &panel=plots                the open panel; "none" for none
//   &hide=top+bars+captions     parts that are hidden

export const PANELS = ["parameters", "plots", "graph", "message", "events", "health", "log"];
const HIDEABLE = ["top", "bars", "captions"];
export const MOST_COLUMNS = 8;
const LARGEST_WIDTH = 7680;
const MOST_KEYS = 30; // as many streams as a page watches
const KEY = /^[A-Za-z0-9_.~-]+(\/[A-Za-z0-9_.~-]+){2,}$/;
const LONGEST_KEY = 200;

/** @type {any} */
export const PLAIN = { keys: [], only: [], columns: null, width: null, quality: null, panel: null,
	hide: [] };

/** Return the layout of a fragment, and one sentence for each part of it that is not allowed. */
export function readLayout(fragment) {
	const layout = { ...PLAIN };
	const refused = [];
	const [streams, options = ""] = fragment.split("?", 2);
	layout.keys = keysOf(streams, "stream", refused);
	for (const option of options.split("&").filter(Boolean)) {
		const [name, value = ""] = option.split("=", 2);
		if (Object.hasOwn(READERS, name)) READERS[name](layout, value, refused);
		else refused.push(`${cut(name)} is unknown; allowed: ${Object.keys(READERS).join(", ")}`);
	}
	return { layout, refused };
}

/** Return the fragment of a layout, without "#". */
export function writeLayout({ keys, only, columns, width, quality, panel, hide }) {
	const options = [["only", only.join("+")], ["columns", columns], ["width", width],
		["quality", quality], ["panel", panel], ["hide", hide.join("+")]]
		.filter(([, value]) => value !== null && value !== "")
		.map(([name, value]) => `${name}=${value}`);
	return keys.join("+") + (options.length ? `?${options.join("&")}` : "");
}

const READERS = {
	only: (layout, text, refused) => Object.assign(layout, { only: keysOf(text, "only", refused) }),
	columns: number("columns", MOST_COLUMNS),
	width: number("width", LARGEST_WIDTH),
	quality: number("quality", 100),
	panel: (layout, text, refused) => {
		const allowed = [...PANELS, "none"];
		if (allowed.includes(text)) layout.panel = text;
		else refused.push(`panel = ${cut(text)} is not allowed; allowed: ${allowed.join(", ")}`);
	},
	hide: (layout, text, refused) => {
		const parts = text.split("+").filter(Boolean);
		const wrong = parts.find((part) => !HIDEABLE.includes(part));
		layout.hide = HIDEABLE.filter((part) => parts.includes(part));
		if (wrong) refused.push(`hide = ${cut(wrong)} is not allowed; allowed: ${HIDEABLE.join(", ")}`);
	},
};

function number(name, most) {
	return (layout, text, refused) => {
		const value = /^\d{1,5}$/.test(text) ? Number(text) : 0;
		if (value >= 1 && value <= most) layout[name] = value;
		else refused.push(`${name} = ${cut(text)} is not allowed; allowed: 1 to ${most}`);
	};
}

function keysOf(text, name, refused) {
	const given = [...new Set(text.split("+"))].filter(Boolean);
	const valid = given.filter((key) => key.length <= LONGEST_KEY && KEY.test(key));
	const wrong = given.find((key) => !valid.includes(key));
	if (wrong) {
		refused.push(`${name} = ${cut(wrong)} is not a key; allowed: such as `
			+ "vision/front/image/compressed");
	}
	if (valid.length > MOST_KEYS) refused.push(`${name} has ${valid.length} keys; allowed: ${MOST_KEYS}`);
	return valid.slice(0, MOST_KEYS);
}

function cut(text) {
	return text.length > 40 ? `${text.slice(0, 40)}…` : text;
}
