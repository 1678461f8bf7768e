// Draws zones and lines with their names and counts.

const ZONE_COLOUR = "#7ad3ff";
const LINE_COLOUR = "#ffb347";
const CHOSEN_COLOUR = "#ffffff";
const CORNER = 4;
const ARROW = 9;

/** What is written at a shape; `count` is that of the Tracks message, or undefined. */
export function shapeLabel({ name }, count) {
	const { inside, left, right } = count ?? {};
	if (Number.isFinite(inside)) return `${name}: ${inside} in`;
	return Number.isFinite(right) && Number.isFinite(left) ? `${name}: ${right} →  ${left} ←` : name;
}

/**
 * Draw `shapes`: {zones, lines, counts, chosen, draft}; `counts` is {zones, lines} of a Tracks message,
 * `chosen` a shape whose corners are drawn, `draft` the points of a new one. Returns the labels to
 * draw above all: [text, corner, colour].
 */
export function drawShapes(context, { zones, lines, counts, chosen, draft }, toCanvas, ratio) {
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
			context.lineWidth = width * ratio;
			context.stroke();
		}
	};
	const mark = (points, colour) => {
		context.fillStyle = colour;
		const half = CORNER * ratio;
		for (const { x, y } of points) context.fillRect(x - half, y - half, 2 * half, 2 * half);
	};
	for (const [all, plain, isZone] of [[zones, ZONE_COLOUR, true], [lines, LINE_COLOUR, false]]) {
		for (const shape of all.filter(({ world }) => !world)) {
			const colour = shape === chosen ? CHOSEN_COLOUR : plain;
			const points = shape.points.map(at);
			stroke(points, colour, isZone);
			if (!isZone) drawArrow(context, shape.points, at, colour, ratio);
			if (chosen !== undefined) mark(points, colour);
			const top = points.reduce((best, point) => (point.y < best.y ? point : best));
			const count = counts?.[isZone ? "zones" : "lines"]?.[shape.name];
			labels.push([shapeLabel(shape, count), top, colour]);
		}
	}
	if (draft) {
		stroke(draft.map(at), CHOSEN_COLOUR, false);
		mark(draft.map(at), CHOSEN_COLOUR);
	}
	return labels;
}

/** Draw a triangle at a line's middle that points to its right side, also in a mirrored picture. */
function drawArrow(context, [[ax, ay], [bx, by]], at, colour, ratio) {
	const length = Math.hypot(bx - ax, by - ay);
	const middle = [(ax + bx) / 2, (ay + by) / 2];
	const from = at(middle);
	const to = at([middle[0] - (by - ay) / length, middle[1] + (bx - ax) / length]);
	const size = ARROW * ratio / Math.hypot(to.x - from.x, to.y - from.y);
	const [dx, dy] = [(to.x - from.x) * size, (to.y - from.y) * size];
	context.fillStyle = colour;
	context.beginPath();
	context.moveTo(from.x + 1.4 * dx, from.y + 1.4 * dy);
	context.lineTo(from.x - 0.7 * dy, from.y + 0.7 * dx);
	context.lineTo(from.x + 0.7 * dy, from.y - 0.7 * dx);
	context.fill();
}
