// One stream large, others of its camera beside it, all of the same frame, with overlay.

import { Choices } from "./choices.js";
import { byId, mark, say } from "./elements.js";
import { Figures } from "./figures.js";
import { FrameFeed } from "./frames.js";
import { inOrder, silenceOf, topicName } from "./naming.js";
import { PaneView } from "./panes.js";
import { Playback } from "./playback.js";
import { saveDrawn, saveOriginal } from "./saving.js";

const TICK_MS = 200;

export class Large extends PaneView {
	constructor(system, watches, connection, go) {
		super();
		Object.assign(this, { system, connection, go });
		this.feed = new FrameFeed(watches, connection);
		this.playback = new Playback((frame, isNew) => this.display(frame, isNew));
		this.figures = new Figures();
		this.choices = new Choices(system, () => this.follow(), (keys) => go(keys));
		this.keys = [];
		this.reset();
		this.feed.on("frame", (frame) => this.playback.arrived(frame));
		system.on("streams", () => this.keys.length && this.follow());
		setInterval(() => this.tick(), TICK_MS);
	}

	get isOpen() {
		return this.keys.length > 0;
	}

	get key() {
		return this.keys[0] ?? null;
	}

	get camera() {
		return this.lead?.camera ?? null;
	}

	open(keys) {
		const isOther = keys[0] !== this.keys[0];
		this.keys = keys;
		if (isOther) this.reset();
		this.followed = null;
		this.follow();
	}

	close() {
		this.keys = [];
		this.followed = null;
		this.feed.close();
		this.reset();
		this.setPanes([]);
	}

	togglePause() {
		this.playback.toggle();
		byId("pause").setAttribute("aria-pressed", String(this.playback.paused));
		this.tick();
	}

	/** Show the frame before (-1) or after (1), and pause. */
	step(by) {
		if (!this.playback.paused) this.togglePause();
		this.playback.step(by);
	}

	fullScreen() {
		if (document.fullscreenElement) document.exitFullscreen();
		else byId("large").requestFullscreen?.();
	}

	toggleOverlay() {
		this.choices.toggleAll();
	}

	save() {
		if (this.frame?.items.get(this.lead.key)) saveOriginal(this.frame, this.lead);
	}

	saveDrawn() {
		if (this.frame?.items.get(this.lead.key)) {
			saveDrawn(this.frame, this.lead, this.overlay(this.panes[0]));
		}
	}

	/** Show the next stream of the wall's order (1), or the one before (-1). */
	neighbour(by) {
		const all = inOrder(this.system.streams);
		const at = all.findIndex((stream) => stream.key === this.keys[0]);
		if (all.length) this.go([all[(at + by + all.length) % all.length].key]);
	}

	reset() {
		this.playback.reset();
		this.look("fit", this.view);
		this.figures.clear();
		this.frame = null;
		this.pointer = null;
		byId("pause").setAttribute("aria-pressed", "false");
	}

	/** Follow what is chosen and there; again only if that changed. */
	follow() {
		const streams = this.keys.map((key) => this.system.stream(key)).filter(Boolean);
		this.lead = this.system.stream(this.keys[0]) ?? null;
		this.title();
		if (!this.lead) return;
		const pictures = streams.map((stream) => stream.key);
		const messages = this.choices.overlayKeys(this.lead.camera);
		this.choices.write(this.keys, this.lead.camera);
		byId("overlay-toggle").setAttribute("aria-pressed", String(this.choices.isOn));
		this.feed.joiner.onlyComplete = this.choices.onlyComplete;
		const followed = JSON.stringify([pictures, messages]);
		if (followed !== this.followed) {
			this.followed = followed;
			this.setPanes(streams);
			this.figures.clear();
			this.feed.follow(pictures, messages);
		}
		this.requestPaint();
	}

	display(frame, isNew) {
		const before = this.frame?.header;
		this.frame = frame;
		for (const pane of this.panes) pane.take(frame);
		if (isNew) {
			const isComplete = !frame.missing.some((key) => this.feed.messages.includes(key));
			this.figures.add(performance.now(), isComplete);
		}
		const { width, height } = frame.header;
		if (before?.width !== width || before.height !== height) this.resized();
		this.requestPaint();
	}

	paint() {
		if (!this.lead) return;
		super.paint();
		const { words, isWithout } = this.figures.joining(this.frame, this.feed, this.feed.messages);
		this.panes[0]?.badge(words, isWithout);
	}

	/** What is drawn over a pane: nothing where the tracker has drawn already. */
	overlay(pane) {
		const isDrawn = topicName(this.system.stream(pane.key) ?? this.lead) === "tracked";
		const keys = isDrawn ? [] : this.feed.messages;
		return { keys, trails: this.choices.trails ? this.feed.trails : null };
	}

	title() {
		say(byId("large-camera"), this.lead?.camera ?? "");
		say(byId("large-topic"), this.lead ? topicName(this.lead) : this.keys[0] ?? "");
	}

	tick() {
		if (!this.isOpen) return;
		const live = this.connection.isOpen && !this.playback.paused && Boolean(this.lead?.live)
			&& this.feed.isLive(performance.now());
		const words = live ? "" : this.words();
		mark(byId("large"), "live", live);
		mark(byId("large"), "paused", this.playback.paused);
		say(byId("large-state"), this.playback.paused ? "paused" : live ? "live" : "not live");
		byId("unknown").hidden = Boolean(this.lead);
		for (const pane of this.panes) pane.judge(live, words);
		this.figures.write(this.frame, this.feed, this.lead?.key ?? "", this.playback.paused, live);
	}

	words() {
		if (this.playback.paused || !this.lead) return "";
		if (!this.connection.isOpen) return "not connected to the viewer's server";
		const now = performance.now();
		const meter = this.feed.meter(this.lead.key);
		if (this.feed.endedSince === null && meter.isLive(now) && this.lead.live) {
			return "waiting for a frame with its overlay";
		}
		return silenceOf(this.lead, this.feed.endedSince, meter, now, this.system.now);
	}
}
