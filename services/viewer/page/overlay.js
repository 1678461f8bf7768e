// Boxes, centres, ids and trails on a canvas, in the frame's own coordinates.

import { marksOf } from "./trails.js";
import { toPane } from "./viewport.js";

export const CENTROID_COLOUR = "#00ff00"; // the tutorial's green
const TRACK_COLOURS = ["#ffd400", "#ff6ad5", "#36c5ff", "#ff8a3c", "#b48cff", "#8affc1"];
const OUTLINE = "rgba(0, 0, 0, 0.65)";
const LONGEST_STEP = 0.06; // of the frame's width
const DASHES = { lost: [4, 4], tentative: [2, 3] };

/**
 * Draw the messages `keys` of a frame; `trails` is a Trails or null, `ratio` device pixels per CSS
 * pixel. Returns what was drawn, in the frame's pixels: [{key, id, box, x, y}].
 */
export function drawOverlay(context, frame, keys, trails, view, pane, ratio) {
	const drawn = [];
	const labels = []; // last, so that no line crosses them
	for (const key of keys) {
		const body = frame.items.get(key);
		if (!body) continue;
		const marks = marksOf(body);
		if (trails) {
			const paths = trails.upTo(key, frame.header);
			for (const { id } of marks) {
				drawTrail(context, id, paths.get(id) ?? [], frame, view, pane, ratio);
			}
		}
		for (const marked of marks) {
			labels.push(drawMark(context, marked, view, pane, ratio));
			drawn.push({ key, id: marked.id, box: marked.box, x: marked.x, y: marked.y });
		}
	}
	for (const [text, corner, colour] of labels) drawLabel(context, text, corner, colour, ratio);
	return drawn;
}

export function colourOf(id) {
	return id === "" ? CENTROID_COLOUR : TRACK_COLOURS[Number(id) % TRACK_COLOURS.length];
}

function drawMark(context, marked, view, pane, ratio) {
	const [left, top, width, height] = marked.box;
	const from = toPane(view, pane, { x: left, y: top });
	const to = toPane(view, pane, { x: left + width, y: top + height });
	const centre = toPane(view, pane, { x: marked.x, y: marked.y });
	const colour = colourOf(marked.id);
	for (const [style, line] of [[OUTLINE, 4], [colour, 2]]) {
		context.strokeStyle = style;
		context.lineWidth = line * ratio;
		context.setLineDash((style === colour ? DASHES[marked.state] ?? [] : []).map((d) => d * ratio));
		context.strokeRect(from.x, from.y, to.x - from.x, to.y - from.y);
	}
	context.setLineDash([]);
	disc(context, centre, 4.5 * ratio, OUTLINE);
	disc(context, centre, 3.5 * ratio, colour);
	// A centroid's numbers stand at its centre, so that its box may share a corner with a track's.
	const corner = marked.id === "" ? { x: centre.x + 8 * ratio, y: centre.y - 4 * ratio } : from;
	return [marked.label, corner, colour];
}

function disc(context, { x, y }, radius, colour) {
	context.fillStyle = colour;
	context.beginPath();
	context.arc(x, y, radius, 0, 2 * Math.PI);
	context.fill();
}

function drawLabel(context, text, corner, colour, ratio) {
	const size = 12 * ratio;
	context.font = `600 ${size}px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace`;
	context.textBaseline = "alphabetic";
	const width = context.measureText(text).width + 6 * ratio;
	// Above the box; inside it where the picture ends.
	const above = corner.y - size * 1.35 > 0;
	const top = above ? corner.y - size * 1.35 - ratio : corner.y + ratio;
	context.fillStyle = colour;
	context.fillRect(corner.x - ratio, top, width, size * 1.35);
	context.fillStyle = "#000";
	context.fillText(text, corner.x + 2 * ratio, top + size * 1.05);
}

/** A trail is broken where it jumps: the largest thing is then another one. */
function drawTrail(context, id, points, { header }, view, pane, ratio) {
	const longest = header.width * LONGEST_STEP;
	context.lineWidth = 1.5 * ratio;
	context.lineJoin = "round";
	context.strokeStyle = colourOf(id);
	context.globalAlpha = 0.85;
	context.beginPath();
	points.forEach(([x, y], index) => {
		const at = toPane(view, pane, { x, y });
		const before = points[index - 1];
		const isStep = before && Math.hypot(x - before[0], y - before[1]) < longest;
		if (isStep) context.lineTo(at.x, at.y);
		else context.moveTo(at.x, at.y);
	});
	context.stroke();
	context.globalAlpha = 1;
}
