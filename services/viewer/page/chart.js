// One chart of lines over time, on a canvas. Gaps stay gaps.

const GAP_MS = 3500;
const LEFT = 46;
const RIGHT = 8;
const TOP = 6;
const BOTTOM = 18;

/**
 * Draw lines: `lines` is [{colour, dash, points: [{at, value}]}], `span` {from, to} in ms, `look`
 * {grid, text, font} colours, `cursor` a time to mark or null.
 */
export function drawChart(canvas, lines, span, look, cursor = null) {
  const ratio = devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const values = lines.flatMap((line) => line.points
    .filter((point) => point.at >= span.from && point.value !== null).map((point) => point.value));
  const { low, high, ticks } = axis(values);
  const x = (at) => LEFT + ((at - span.from) / (span.to - span.from)) * (width - LEFT - RIGHT);
  const y = (value) => TOP + (1 - (value - low) / (high - low)) * (height - TOP - BOTTOM);
  drawGrid(context, { x, y, ticks, span, width, height, look });
  context.save();
  context.beginPath();
  context.rect(LEFT, 0, width - LEFT - RIGHT, height - BOTTOM + 1);
  context.clip();
  for (const line of lines) drawLine(context, line, x, y);
  context.restore();
  if (cursor !== null) {
    context.strokeStyle = look.text;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(Math.round(x(cursor)) + 0.5, TOP);
    context.lineTo(Math.round(x(cursor)) + 0.5, height - BOTTOM);
    context.stroke();
  }
}

/** The time under a place of the canvas, CSS pixels. */
export function timeAt(canvas, place, span) {
  const share = (place - LEFT) / (canvas.clientWidth - LEFT - RIGHT);
  return span.from + Math.min(1, Math.max(0, share)) * (span.to - span.from);
}

/** A scale from 0 (or the least) to a round number, with two to four ticks. */
export function axis(values) {
  const top = values.reduce((most, value) => Math.max(most, value), 0);
  const bottom = values.reduce((least, value) => Math.min(least, value), 0);
  const extent = top - bottom || 1;
  const rough = extent / 3;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((by) => by * power).find((by) => by >= rough);
  const low = Math.floor(bottom / step) * step;
  const high = Math.ceil((top || extent) / step) * step;
  const ticks = [];
  for (let value = low; value <= high + step / 2; value += step) {
    ticks.push(Number(value.toPrecision(6)));
  }
  return { low, high, ticks };
}

function drawGrid(context, { x, y, ticks, span, width, height, look }) {
  context.font = look.font;
  context.fillStyle = look.text;
  context.strokeStyle = look.grid;
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticks) {
    const at = Math.round(y(tick)) + 0.5;
    context.beginPath();
    context.moveTo(LEFT, at);
    context.lineTo(width - RIGHT, at);
    context.stroke();
    context.fillText(String(tick), LEFT - 6, at);
  }
  context.textBaseline = "alphabetic";
  const minutes = Math.round((span.to - span.from) / 60_000);
  for (let back = 0; back <= minutes; back += 1) {
    const at = x(span.to - back * 60_000);
    context.textAlign = back === 0 ? "right" : back === minutes ? "left" : "center";
    context.fillText(back === 0 ? "now" : `−${back}${back === minutes ? " min" : ""}`, at, height - 4);
  }
}

function drawLine(context, { colour, dash, points }, x, y) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  context.setLineDash(dash ?? []);
  context.beginPath();
  let before = null;
  for (const { at, value } of points) {
    if (value === null) {
      before = null;
      continue;
    }
    if (before === null || at - before > GAP_MS) context.moveTo(x(at), y(value));
    else context.lineTo(x(at), y(value));
    before = at;
  }
  context.stroke();
  context.setLineDash([]);
}
