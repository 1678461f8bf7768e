// Draws boxes, centres, ids and trails of messages on a canvas.

import { between } from "../transport/connection.js";
import { drawShapes } from "./shape_marks.js";

const TRAIL_MS = 2000;
const POINTS_KEPT = 400;
const CENTROID_COLOUR = "#00ff00"; // the tutorial's green
const TRACK_COLOURS = ["#ffd400", "#ff6ad5", "#36c5ff", "#ff8a3c", "#b48cff", "#8affc1"];
const OUTLINE = "rgba(0, 0, 0, 0.65)";
const LONGEST_STEP = 0.06; // of the frame's width
const LABEL_PX = 12;
const DASHES = new Map([["lost", [4, 4]], ["tentative", [2, 3]]]);

/** The positions of objects in the last seconds, by stream and id. */
export class Trails {
	streams = new Map();

	/** Keep the positions of one message: a centroid or tracks. */
	add(key, header, body) {
		const { epoch, seq, stamp_ns: stamp } = header;
		if (this.streams.get(key)?.epoch !== epoch) this.streams.set(key, { epoch, points: [] });
		const { points } = this.streams.get(key);
		points.push({ seq, stamp, marks: marksOf(body) });
		if (points.length > POINTS_KEPT) points.shift();
	}

	/** Return id -> [[x, y], ...], oldest first, of the two seconds up to this frame. */
	upTo(key, header) {
		const kept = this.streams.get(key);
		const trails = new Map();
		if (kept?.epoch !== header.epoch) return trails;
		for (const { seq, stamp, marks } of kept.points) {
			if (seq > header.seq || between(stamp, header.stamp_ns) > TRAIL_MS) continue;
			for (const { id, x, y } of marks) {
				if (!trails.has(id)) trails.set(id, []);
				trails.get(id).push([x, y]);
			}
		}
		return trails;
	}
}

/** The words at a track's box: its id, its class and score if a model says them, and its state. */
function labelOf(track) {
	const words = [`${track?.id}`];
	if (typeof track?.class === "string") {
		words.push(track.class);
		if (Number.isFinite(track.score)) words.push(`${Math.round(100 * track.score)}%`);
	}
	if (track?.state !== "confirmed") words.push(`${track?.state}`);
	return words.join(" ");
}

/** The objects of a message: [{id, label, x, y, box, state}]; id "" is a centroid. */
export function marksOf({ tracks, x, y, box }) {
	const marks = Array.isArray(tracks) ? tracks.map((track) => ({ ...track, label: labelOf(track) }))
		: [{ id: "", label: `${x}, ${y}`, x, y, box, state: "confirmed" }];
	// Fields unknown to the server are passed on unchanged, and may have any value.
	return marks.filter((mark) => Array.isArray(mark.box) && mark.box.length === 4
		&& [mark.x, mark.y, ...mark.box].every(Number.isFinite));
}

/**
 * Draw the messages `keys` of a frame; `trails` is a Trails or null, `shapes` those of drawShapes or
 * null, `toCanvas(point)` maps a point of the frame to the canvas, whose unit is a CSS pixel. Returns
 * what was drawn: `marks`, in the frame's pixels, [{key, id, box, x, y}], and the words at the `shapes`.
 */
export function drawOverlay(context, frame, { keys, trails, shapes }, toCanvas) {
	const drawn = [];
	const labels = shapes ? drawShapes(context, shapes, toCanvas) : []; // drawn last
	const words = labels.map(([text]) => text);
	for (const key of keys.filter((one) => frame.items.has(one))) {
		const marks = marksOf(frame.items.get(key));
		const paths = trails?.upTo(key, frame.header);
		for (const { id } of marks) {
			drawTrail(context, paths?.get(id) ?? [], colourOf(id), frame.header.width, toCanvas);
		}
		for (const mark of marks) {
			labels.push(drawMark(context, mark, toCanvas));
			drawn.push({ key, id: mark.id, box: mark.box, x: mark.x, y: mark.y });
		}
	}
	for (const [text, corner, colour] of labels) drawLabel(context, text, corner, colour);
	return { marks: drawn, shapes: words };
}

function colourOf(id) {
	return id === "" ? CENTROID_COLOUR : TRACK_COLOURS[Number(id) % TRACK_COLOURS.length];
}

/** Draw box and centre; returns the label that belongs to them: [text, corner, colour]. */
function drawMark(context, mark, toCanvas) {
	const [left, top, width, height] = mark.box;
	const one = toCanvas({ x: left, y: top });
	const other = toCanvas({ x: left + width, y: top + height });
	const from = { x: Math.min(one.x, other.x), y: Math.min(one.y, other.y) }; // a frame may be turned
	const centre = toCanvas(mark);
	const colour = colourOf(mark.id);
	for (const { style, line } of [{ style: OUTLINE, line: 4 }, { style: colour, line: 2 }]) {
		context.strokeStyle = style;
		context.lineWidth = line;
		context.setLineDash(style === colour ? DASHES.get(mark.state) ?? [] : []);
		context.strokeRect(from.x, from.y, Math.abs(other.x - one.x), Math.abs(other.y - one.y));
	}
	context.setLineDash([]);
	for (const { style, radius } of [{ style: OUTLINE, radius: 4.5 }, { style: colour, radius: 3.5 }]) {
		context.fillStyle = style;
		context.beginPath();
		context.arc(centre.x, centre.y, radius, 0, 2 * Math.PI);
		context.fill();
	}
	// A centroid's numbers are at its centre, since its box may share a corner with a track's.
	const corner = mark.id === "" ? { x: centre.x + 8, y: centre.y - 4 } : from;
	return [mark.label, corner, colour];
}

function drawLabel(context, text, corner, colour) {
	context.font = `600 ${LABEL_PX}px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace`;
	context.textBaseline = "alphabetic";
	const width = context.measureText(text).width + 6;
	// Above the box, or inside it at the border of the picture.
	const height = LABEL_PX * 1.35;
	const top = corner.y > height ? corner.y - height - 1 : corner.y + 1;
	context.fillStyle = colour;
	context.fillRect(corner.x - 1, top, width, height);
	context.fillStyle = "#000";
	context.fillText(text, corner.x + 2, top + LABEL_PX * 1.05);
}

/** A trail is interrupted at jumps, where the largest object has changed. */
function drawTrail(context, points, colour, frameWidth, toCanvas) {
	context.lineWidth = 1.5;
	context.lineJoin = "round";
	context.strokeStyle = colour;
	context.globalAlpha = 0.85;
	context.beginPath();
	points.forEach(([x, y], index) => {
		const at = toCanvas({ x, y });
		const before = points[index - 1];
		const isStep = before && Math.hypot(x - before[0], y - before[1]) < frameWidth * LONGEST_STEP;
		if (isStep) context.lineTo(at.x, at.y);
		else context.moveTo(at.x, at.y);
	});
	context.stroke();
	context.globalAlpha = 1;
}
