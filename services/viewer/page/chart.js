// One chart of lines over time, on a canvas. Gaps stay gaps.

const GAP_MS = 3500;
const LEFT = 46;
const RIGHT = 8;
const TOP = 6;
const BOTTOM = 18;

/**
 * Draw `lines` [{colour, dash, points: [{at, value}]}] over `span` {from, to} in ms, with `look`
 * {grid, text, font}.
 */
export function drawChart(canvas, lines, span, look) {
	const ratio = devicePixelRatio || 1;
	const { clientWidth: width, clientHeight: height } = canvas;
	canvas.width = Math.round(width * ratio); // clears it, too
	canvas.height = Math.round(height * ratio);
	const context = canvas.getContext("2d");
	context.scale(ratio, ratio);
	const { high, ticks } = axis(lines.flatMap((line) => line.points.map(({ value }) => value)));
	const x = (at) => LEFT + ((at - span.from) / (span.to - span.from)) * (width - LEFT - RIGHT);
	const y = (value) => TOP + (1 - value / high) * (height - TOP - BOTTOM);
	context.font = look.font;
	context.fillStyle = look.text;
	context.textAlign = "right";
	for (const tick of ticks) {
		context.fillText(String(tick), LEFT - 6, y(tick) + 4);
		stroke(context, look.grid, 1, [[LEFT, y(tick)], [width - RIGHT, y(tick)]]);
	}
	const minutes = Math.round((span.to - span.from) / 60_000);
	for (let back = 0; back <= minutes; back += 1) {
		const words = back === 0 ? "now" : `−${back}`;
		context.fillText(words, x(span.to - back * 60_000) + (back ? 8 : 0), height - 4);
	}
	for (const { colour, dash = [], points } of lines) {
		context.setLineDash(dash);
		const seen = points.filter(({ at, value }) => at >= span.from && value !== null);
		stroke(context, colour, 1.5, seen.map(({ at, value }) => [x(at), y(value), at]));
		context.setLineDash([]);
	}
}

/** A scale from 0 to a round number, with a few ticks; what is null is left out. */
export function axis(values) {
	const top = values.reduce((most, value) => Math.max(most, value), 0) || 1;
	const power = 10 ** Math.floor(Math.log10(top / 3));
	const step = [1, 2, 2.5, 5, 10].map((by) => by * power).find((by) => by >= top / 3);
	const count = Math.ceil(top / step - 1e-9);
	const ticks = Array.from({ length: count + 1 }, (_, index) =>
		Number((index * step).toPrecision(6)));
	return { high: ticks.at(-1), ticks };
}

function stroke(context, colour, width, points) {
	context.strokeStyle = colour;
	context.lineWidth = width;
	context.beginPath();
	points.forEach(([x, y, at], index) => {
		const isOn = index && !(at - points[index - 1][2] > GAP_MS);
		if (isOn) context.lineTo(x, y);
		else context.moveTo(x, y);
	});
	context.stroke();
}
