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
	const corners = [];
	const edges = [];
	for (const kind of Object.keys(KINDS)) {
		shapes[kind].forEach(({ world, points }, index) => (world ? [] : points).forEach((at, corner) => {
			const next = points[(corner + 1) % points.length];
			corners.push({ away: distance(point, at), found: { kind, index, corner } });
			edges.push({ away: distanceToEdge(point, at, next), found: { kind, index, corner: null } });
		}));
	}
	const nearest = (places) => places.filter(({ away }) => away <= reach)
		.sort((one, other) => one.away - other.away)[0]?.found;
	return nearest(corners) ?? nearest(edges) ?? null;
}
