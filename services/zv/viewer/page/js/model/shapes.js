// Zones, lines and regions: reads and writes them as the tracker's texts, and finds the one near a
// point. A shape is {name, world, points}; points are [x, y], in pixels of the frame unless `world`
// is true.

/** What one shape of each kind is called. Each kind is a parameter of the tracker. */
export const KINDS = { zones: "zone", lines: "line", regions: "region", ignore: "ignored" };

/** Read the shapes of a text that the tracker has accepted; what cannot be drawn is left out. */
export function readShapes(text) {
	return text.replace(/#.*/g, "").replace(/\s*,\s*/g, ",").split(/[;\n]/)
		.map((shape) => shape.split(/\s+/).filter(Boolean)).filter((words) => words.length)
		.map(([name, ...words]) => ({ name, world: words[0] === "world",
			points: words.filter((word) => word.includes(",")).map((word) => word.split(",").map(Number)) }))
		.filter(({ points }) => points.length > 1 && points.flat().every(Number.isFinite));
}

export function writeShapes(shapes) {
	return shapes.map(({ name, world, points }) =>
		[name, ...(world ? ["world"] : []), ...points.map((point) => point.join())].join(" ")).join("; ");
}

/** The first of "zone1", "zone2", ... that no shape of its kind has. */
export function freeName(kind, shapes) {
	let number = 1;
	while (shapes.some(({ name }) => name === `${KINDS[kind]}${number}`)) number += 1;
	return `${KINDS[kind]}${number}`;
}

export function distance([ax, ay], [bx, by]) {
	return Math.hypot(ax - bx, ay - by);
}

/** How far a point is from the edge between two others. */
export function distanceToEdge([x, y], [ax, ay], [bx, by]) {
	const [dx, dy] = [bx - ax, by - ay];
	const along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
	const share = Math.min(1, Math.max(0, along));
	return distance([x, y], [ax + share * dx, ay + share * dy]);
}

/**
 * Find the corner within `reach` of a point, or else the edge: {kind, index, corner}, where
 * `corner` is null for an edge. Null if there is neither. `shapes` has a list for each kind.
 */
export function shapeAt(shapes, point, reach) {
	/** @type {any} */
	let best = null;
	const offer = (away, found) => {
		if (away <= reach && !(best && best.away <= away)) best = { away, found };
	};
	for (const isCorner of [true, false]) {
		for (const kind of Object.keys(KINDS)) {
			shapes[kind].forEach(({ world, points }, index) => points.forEach((at, corner) => {
				if (world) return;
				const next = points[(corner + 1) % points.length];
				offer(isCorner ? distance(point, at) : distanceToEdge(point, at, next),
					{ kind, index, corner: isCorner ? corner : null });
			}));
		}
		if (best) break;
	}
	return best?.found ?? null;
}
