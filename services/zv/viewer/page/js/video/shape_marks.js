// Draws zones, lines and regions with their names and counts.

const COLOURS = { ignore: "#ff7a90", regions: "#8fe388", zones: "#7ad3ff", lines: "#ffb347" };
const CHOSEN_COLOUR = "#ffffff";
const CORNER = 4;
const ARROW = 9;
const DIRECTIONS = "→↘↓↙←↖↑↗"; // clockwise, as y points down

/**
 * The text at a shape. `count` is its count in the Tracks message, or undefined; `toRight` is the
 * direction in which a line's right side lies on the canvas.
 */
export function shapeLabel({ name }, count, toRight) {
	const { inside, left, right } = count ?? {};
	if (Number.isFinite(inside)) return `${name}: ${inside} in`;
	if (!Number.isFinite(right) || !Number.isFinite(left)) return name;
	const eighth = Math.round(Math.atan2(toRight.y, toRight.x) * 4 / Math.PI) + 8;
	return `${name}: ${right} ${DIRECTIONS[eighth % 8]}  ${left} ${DIRECTIONS[(eighth + 4) % 8]}`;
}

/**
 * Draw `shapes`: a list for each kind, and {counts, chosen, draft}; `counts` is {zones, lines} of a
 * Tracks message, `chosen` a shape whose corners are drawn, `draft` the points of a new one. Returns the labels to
 * draw above all: [text, corner, colour].
 */
export function drawShapes(context, { counts, chosen, draft, ...shapes }, toCanvas) {
	const labels = [];
	const at = ([x, y]) => toCanvas({ x, y });
	const stroke = (points, colour, isClosed) => {
		context.beginPath();
		for (const { x, y } of points) context.lineTo(x, y);
		if (isClosed) {
			context.closePath();
			context.globalAlpha = 0.12;
			context.fillStyle = colour;
			context.fill();
			context.globalAlpha = 1;
		}
		for (const [style, width] of [["rgba(0, 0, 0, 0.65)", 4], [colour, 2]]) {
			context.strokeStyle = style;
			context.lineWidth = width;
			context.stroke();
		}
	};
	const mark = (points, colour) => {
		context.fillStyle = colour;
		for (const { x, y } of points) context.fillRect(x - CORNER, y - CORNER, 2 * CORNER, 2 * CORNER);
	};
	for (const [kind, plain] of Object.entries(COLOURS)) {
		const isLine = kind === "lines";
		for (const shape of shapes[kind]?.filter(({ world }) => !world) ?? []) {
			const colour = shape === chosen ? CHOSEN_COLOUR : plain;
			const points = shape.points.map(at);
			stroke(points, colour, !isLine);
			const toRight = isLine ? rightSide(shape.points, at) : null;
			if (toRight) drawArrow(context, toRight, colour);
			if (chosen !== undefined) mark(points, colour);
			const top = points.reduce((best, point) => (point.y < best.y ? point : best));
			const own = counts?.[kind] ?? {};
			const count = Object.hasOwn(own, shape.name) ? own[shape.name] : undefined;
			labels.push([shapeLabel(shape, count, toRight), top, colour]);
		}
	}
	if (draft) {
		stroke(draft.map(at), CHOSEN_COLOUR, false);
		mark(draft.map(at), CHOSEN_COLOUR);
	}
	return labels;
}

/** Middle of a line on the canvas, and unit vector to its right side, also of a mirrored picture. */
function rightSide([[ax, ay], [bx, by]], at) {
	const length = Math.hypot(bx - ax, by - ay);
	const [x, y] = [(ax + bx) / 2, (ay + by) / 2];
	const from = at([x, y]);
	const to = at([x - (by - ay) / length, y + (bx - ax) / length]);
	const scale = Math.hypot(to.x - from.x, to.y - from.y);
	return { from, x: (to.x - from.x) / scale, y: (to.y - from.y) / scale };
}

/** Draw a triangle at a line's middle that points to its right side. */
function drawArrow(context, { from, x, y }, colour) {
	const [dx, dy] = [x * ARROW, y * ARROW];
	context.fillStyle = colour;
	context.beginPath();
	context.moveTo(from.x + 1.4 * dx, from.y + 1.4 * dy);
	context.lineTo(from.x - 0.7 * dy, from.y + 0.7 * dx);
	context.lineTo(from.x + 0.7 * dy, from.y - 0.7 * dx);
	context.fill();
}
