// The panel of plots over the last minutes: rate, latency, drops of each node, and the centroid.

import { drawChart, timeAt } from "./chart.js";
import { byId, element, say } from "./elements.js";
import { clock, number } from "./format.js";
import { milliseconds } from "./wire.js";

const SPAN_MS = 5 * 60 * 1000;
const DRAW_MS = 500;
const POINTS_KEPT = 9000; // five minutes at 30 Hz
const POINTS_DRAWN = 1200;

const CHARTS = [
  { name: "rate", title: "Rate", unit: "Hz", fields: [["rate"]] },
  { name: "latency", title: "Latency from capture", unit: "ms", fields: [["p50"], ["p99", [3, 3]]],
    note: "p50, dashed p99" },
  { name: "drops", title: "Drops", unit: "per s", fields: [["drops"]] },
  { name: "x", title: "Centroid x", unit: "pixels" },
  { name: "y", title: "Centroid y", unit: "pixels" },
];

export class PlotsPanel {
  constructor(system, watches, camera) {
    this._system = system;
    this._watches = watches;
    this._camera = camera;
    this._visible = false;
    this._cursor = null;
    this._centroids = [];
    this._choice = byId("plots-camera");
    this._choice.addEventListener("change", () => this._follow());
    this._build();
    system.on("streams", () => this._offerCameras());
    setInterval(() => this._visible && this._draw(), DRAW_MS);
  }

  show(visible) {
    this._visible = visible;
    if (visible) {
      this._offerCameras();
      this._draw();
    } else this._unfollow();
  }

  /** Another camera is looked at. */
  arrange() {
    if (!this._camera() || this._choice.value === this._camera()) return;
    this._offerCameras();
    this._choice.value = this._camera();
    if (this._visible) this._follow();
  }

  _build() {
    this._charts = CHARTS.map((chart) => {
      const canvas = element("canvas", { role: "img", "aria-label": `${chart.title} over 5 minutes`,
        onpointermove: (event) => this._point(canvas, event.offsetX),
        onpointerleave: () => this._point(canvas, null) });
      const legend = element("p", { class: "legend" });
      const title = element("h3", {}, chart.title, element("small", {}, chart.unit));
      byId("plots").append(element("section", { class: "plot", "data-plot": chart.name }, title,
        chart.note ? element("small", { class: "note" }, chart.note) : null, canvas, legend));
      return { ...chart, canvas, legend };
    });
  }

  _offerCameras() {
    const cameras = this._system.cameras;
    const before = this._choice.value || this._camera();
    if ([...this._choice.options].map((option) => option.value).join() !== cameras.join()) {
      this._choice.replaceChildren(
        ...cameras.map((camera) => element("option", { value: camera }, camera)));
      if (cameras.includes(before)) this._choice.value = before;
    }
    if (this._visible) this._follow();
  }

  /** Watch the centroid of the camera that is chosen. */
  _follow() {
    const stream = this._system.streams.find((one) => one.camera === this._choice.value
      && /vision\.Centroid\.v1/.test(one.type));
    if (stream?.key === this._followed) return;
    this._unfollow();
    if (this._centroids.key !== stream?.key) this._centroids = [];
    if (!stream) return;
    this._centroids.key = stream.key;
    this._followed = stream.key;
    this._stop = this._watches.messages(stream.key, ({ header, body }) => {
      this._centroids.push({ at: milliseconds(header.stamp_ns), x: body.x ?? null,
        y: body.y ?? null });
      if (this._centroids.length > POINTS_KEPT) this._centroids.shift();
    });
  }

  _unfollow() {
    this._stop?.();
    this._stop = null;
    this._followed = null;
  }

  _draw() {
    const now = this._system.now;
    const span = { from: now - SPAN_MS, to: now };
    this._span = span;
    const style = getComputedStyle(document.documentElement);
    const look = { grid: style.getPropertyValue("--line"), text: style.getPropertyValue("--dim"),
      font: '11px ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace' };
    for (const chart of this._charts) {
      const lines = chart.fields ? this._ofNodes(chart, style) : this._ofCentroid(chart.name, style);
      drawChart(chart.canvas, lines, span, look, this._cursor);
      this._tell(chart, lines);
    }
  }

  _ofNodes(chart, style) {
    const nodes = this._system.nodes.filter((node) => node.cameras?.includes(this._choice.value)
      && this._system.histories.has(node.node));
    return nodes.flatMap((node, index) => chart.fields.map(([field, dash]) => ({
      name: node.service,
      colour: style.getPropertyValue(`--series-${(index % 6) + 1}`),
      dash,
      points: this._system.histories.get(node.node)
        .map((sample) => ({ at: sample.at, value: sample[field] })),
    })));
  }

  _ofCentroid(field, style) {
    const step = Math.ceil(this._centroids.length / POINTS_DRAWN);
    const points = this._centroids.filter((_, index) => index % step === 0)
      .map((point) => ({ at: point.at, value: point[field] }));
    return points.length ? [{ name: field, colour: style.getPropertyValue("--series-2"), points }]
      : [];
  }

  _point(canvas, place) {
    this._cursor = place === null || !this._span ? null : timeAt(canvas, place, this._span);
    this._draw();
  }

  /** The legend: each line's name, and its value at the cursor or now. */
  _tell(chart, lines) {
    const at = this._cursor ?? Infinity;
    const named = lines.filter((line) => !line.dash);
    const valueOf = ({ points }) => {
      const value = points.findLast((point) => point.at <= at)?.value ?? null;
      return value === null ? "–" : number(value, 1);
    };
    const words = named.map((line) => [line.name, lines.filter(({ name }) => name === line.name)
      .map(valueOf).join(" / ")].join(" "));
    const state = JSON.stringify([words, this._cursor === null]);
    if (chart.state === state) return;
    chart.state = state;
    chart.legend.replaceChildren(...named.map((line, index) => {
      const key = element("i", { class: "key" });
      key.style.color = line.colour;
      return element("span", {}, key, words[index]);
    }));
    if (!lines.length) say(chart.legend, chart.fields ? "no reports yet" : "no centroid yet");
    if (this._cursor !== null) chart.legend.append(element("time", {}, clock(this._cursor)));
  }
}
