// One stream on the wall: a small picture that shows whether the stream is live.

import { StreamStatistics, streamName, topicName } from "../model/streams.js";
import { element, resize, setData, setText } from "../ui/elements.js";
import { duration, shownRate } from "../ui/format.js";

const WIDTHS = [160, 240, 320, 480, 640];
const QUALITY = 70;

export class Tile {
	/** `wall` has what all tiles share. */
	constructor(stream, wall) {
		this.stream = stream;
		this.wall = wall;
		this.isInView = false;
		this.stop = null; // ends the watch
		/** @type {any} */
		this.options = null; // of the watch
		this.statistics = new StreamStatistics();
		this.picture = null; // the one that is painted
		this.nextAt = 0;
		this.canvas = element("canvas", { width: 320, height: 240, "data-live": "false",
			"data-key": stream.key });
		this.context = this.canvas.getContext("2d", { alpha: false });
		this.state = element("span", { class: "tile-state" });
		this.rate = element("span", { class: "tile-rate" });
		this.age = element("span", { class: "tile-age" });
		this.link = element("a", {},
			element("span", { class: "tile-picture" }, this.canvas, this.state),
			element("span", { class: "tile-caption" },
				element("i", { class: "lamp", "aria-hidden": "true" }),
				element("b", {}, stream.camera), element("span", { class: "topic" }, topicName(stream)),
				this.rate, this.age));
		this.element = element("li", { class: "tile", "data-key": stream.key }, this.link);
		wall.observer.observe(this.element);
	}

	close() {
		this.wall.observer.unobserve(this.element);
		this.show(false);
	}

	update(stream) {
		this.stream = stream;
		this.link.href = `#${this.wall.linkTo(this.stream.key)}`;
		this.tick(performance.now());
	}

	/** Watch the stream while the tile is visible. */
	show(visible) {
		if (visible === Boolean(this.stop)) return;
		if (visible) {
			this.options = this.wantedOptions();
			this.stop = this.wall.watches.watchPictures(this.stream.key, this.options, this.statistics,
				(picture, bitmap) => this.paint(picture, bitmap), (taken) => this.delay(taken));
		} else {
			this.stop();
			this.stop = null;
			this.statistics = new StreamStatistics(this.statistics.endedSince);
			this.picture = null; // it is not live
			this.nextAt = 0;
		}
	}

	/** Watch the stream in another size if the tile's size or the choice for its stream has changed. */
	resize() {
		if (!this.stop) return;
		const { width, quality } = this.wantedOptions();
		if (width === this.options.width && quality === this.options.quality) return;
		this.show(false);
		this.show(true);
	}

	tick(now) {
		const { statistics, stream, picture } = this;
		const live = this.stop !== null && statistics.isLive(now) && stream.live;
		const isWaiting = stream.live && statistics.endedSince === null && statistics.lastAt === null;
		setData(this.canvas, { live });
		setData(this.element, { state: live ? "live" : isWaiting ? "waiting" : "stopped" });
		const { system, watches } = this.wall;
		const silence = live ? "" : system.isLinkLost ? "link lost"
			: watches.isLeftOut(this.stream.key) ? "too many are in view at once"
				: statistics.explainSilence(stream, now, system.now);
		setText(this.state, silence);
		// Names the link for those who cannot see the picture.
		const label = `Show ${streamName(stream)} large, ${silence.replace("\n", ", ") || "live"}`;
		if (this.link.ariaLabel !== label) this.link.ariaLabel = label;
		setText(this.rate, live ? shownRate(statistics.arrivalRate(now), statistics.rate(now)) : "");
		setText(this.age, live && picture ? duration(picture.ageMs + now - picture.at) : "");
	}

	/** The displayed size, unless a smaller one is chosen, and the quality. */
	wantedOptions() {
		const pixels = (this.element.clientWidth || 320) * Math.min(devicePixelRatio || 1, 2);
		const displayed = WIDTHS.find((width) => width >= pixels * 0.9) ?? Math.max(...WIDTHS);
		const { width, quality } = this.wall.transfer.of(this.stream.key);
		return { width: Math.min(displayed, width ?? displayed), quality: quality ?? QUALITY };
	}

	/** Call `taken` when this tile's next picture is due; the server then sends the newest. */
	delay(taken) {
		const now = performance.now();
		const wait = this.nextAt - now;
		this.nextAt = Math.max(now, this.nextAt) + this.wall.pace();
		if (wait > 1) setTimeout(taken, wait);
		else taken();
	}

	paint(picture, bitmap) {
		this.picture = picture;
		const orientation = this.wall.orientations.of(this.stream.camera);
		resize(this.canvas, orientation.size(bitmap));
		this.context.setTransform(...orientation.transform(bitmap));
		this.context.drawImage(bitmap, 0, 0);
		bitmap.close();
		setData(this.canvas, { epoch: picture.header.epoch, seq: picture.header.seq });
		this.tick(performance.now());
	}
}
