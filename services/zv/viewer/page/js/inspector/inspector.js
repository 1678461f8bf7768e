// The large view: one stream, others of its camera beside it, all of the same frame, the overlay,
// and below it age, rate, losses, size and frame number.

import { saveDrawn, saveOriginal } from "../export/saving.js";
import { pictureStreams, staysBare, stepKeys, topicName } from "../model/streams.js";
import { watchOptions } from "../model/transfer.js";
import { byId, setData, setText } from "../ui/elements.js";
import { number } from "../ui/format.js";
import { FrameFeed } from "../video/frame_joiner.js";
import { Playback } from "../video/playback.js";
import { Adjust } from "./adjust.js";
import { writeFigures } from "./figures.js";
import { Menus } from "./menus.js";
import { PaneGrid } from "./pane_grid.js";
import { ShapeEditor } from "./shape_editor.js";
import { TransferMenu } from "./transfer_menu.js";

const TICK_MS = 200;
const WINDOW_MS = 1000;

export class Inspector extends PaneGrid {
	/**
	 * `go(keys, part)` shows other streams, in a layout with this part changed. `orientations` and
	 * `transfer` are the page's choices for the streams; `setTransfer(choice)` changes `transfer`
	 * for all of them.
	 */
	constructor(system, watches, connection, go, { orientations, transfer, setTransfer }) {
		super();
		Object.assign(this, { system, connection, go, transfer });
		this.playback = new Playback((frame, isNew) => this.display(frame, isNew));
		this.feed = new FrameFeed(watches, connection, (frame) => this.playback.add(frame));
		this.menus = new Menus(system, () => this.follow(), go);
		this.adjust = new Adjust(orientations, () => this.follow());
		this.transferMenu = new TransferMenu(transfer, setTransfer, () => this.follow());
		this.editor = new ShapeEditor(system, connection, () => this.requestPaint());
		this.keys = [];
		this.reset();
		system.on("streams", () => this.isOpen && this.follow());
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
		const isOther = keys[0] !== this.key;
		this.keys = keys;
		if (isOther) this.reset();
		this.followed = null;
		this.follow();
	}

	close() {
		this.keys = [];
		this.editor.follow(null);
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

	/** Show all steps of the edge detector of this camera, and its parameters. */
	showSteps() {
		this.go(stepKeys(this.system.streams, this.camera), { panel: "parameters" });
	}

	fullScreen() {
		if (document.fullscreenElement) document.exitFullscreen();
		else byId("large").requestFullscreen?.();
	}

	toggleOverlay() {
		this.menus.set("overlayOn", !this.menus.overlayOn);
	}

	editShapes() {
		this.editor.toggle();
	}

	save() {
		if (this.picture) saveOriginal(this.frame, this.lead);
	}

	saveDrawn() {
		if (!this.picture) return;
		this.paint(); // a new frame may not be painted yet
		saveDrawn(this.frame, this.lead, this.overlayOf(this.panes[0]), this.panes[0].toned.image);
	}

	/** Change how the picture is shown: "rotate", "mirror" or "toggleStretch". */
	change(how) {
		this.adjust[how]();
	}

	/** Open the menu with the stream's addresses and copy the first. */
	copyAddress() {
		if (!byId("transfer-menu").matches(":popover-open")) byId("transfer-button").click();
		this.transferMenu.copy("stream");
	}

	/** Show the next stream of the wall's order (1), or the one before (-1). */
	neighbour(by) {
		const all = pictureStreams(this.system.streams);
		const at = all.findIndex((stream) => stream.key === this.key);
		if (all.length) this.go([all[(at + by + all.length) % all.length].key]);
	}

	reset() {
		this.playback.reset();
		this.shown = []; // the frames of the last second: {now, isComplete}
		this.frame = null;
		this.pointer = null;
		this.fit();
		byId("pause").setAttribute("aria-pressed", "false");
	}

	/** Follow the chosen streams that exist; restart only if these changed. */
	follow() {
		const streams = this.keys.map((key) => this.system.stream(key)).filter(Boolean);
		this.lead = this.system.stream(this.key) ?? null;
		setText(byId("large-camera"), this.lead?.camera ?? "");
		setText(byId("large-topic"), this.lead ? topicName(this.lead) : this.key);
		byId("steps").hidden = !stepKeys(this.system.streams, this.camera).length;
		if (!this.lead) return;
		const pictures = streams.map((stream) => stream.key);
		const messages = this.menus.overlayKeys(this.lead.camera);
		this.menus.write(this.keys, this.lead.camera);
		byId("overlay-toggle").setAttribute("aria-pressed", String(this.menus.overlayOn));
		this.feed.joiner.onlyComplete = this.menus.onlyComplete;
		this.adjust.follow(this.lead);
		this.transferMenu.follow(this.lead, this.frame?.header);
		this.turn(this.adjust.orientation);
		this.editor.follow(this.camera);
		const optionsOf = (key) => ({ ...watchOptions(this.transfer.of(key)), values: true });
		const followed = JSON.stringify([pictures, pictures.map(optionsOf), messages]);
		if (followed !== this.followed) {
			this.followed = followed;
			this.setPanes(streams);
			this.shown = [];
			this.feed.follow(pictures, messages, optionsOf);
		}
		this.requestPaint();
	}

	/** The leading picture of the current frame, as received. */
	get picture() {
		return this.frame?.items.get(this.lead?.key)?.picture;
	}

	/** The messages that are missing in the current frame. */
	get missing() {
		return this.frame.missing.filter((key) => this.feed.messages.includes(key));
	}

	display(frame, isNew) {
		const before = this.frame?.header;
		this.frame = frame;
		for (const pane of this.panes) pane.take(frame);
		if (isNew) {
			const now = performance.now();
			this.shown.push({ now, isComplete: !this.missing.length });
			while (now - this.shown[0].now > WINDOW_MS) this.shown.shift();
		}
		const { width, height } = frame.header;
		if (before?.width !== width || before.height !== height) this.resized();
		this.requestPaint();
	}

	paint() {
		if (!this.lead) return;
		super.paint();
		if (this.panes[0].item) this.adjust.draw(this.panes[0].toned);
		setText(this.panes[0].badge, this.overlayState());
		setData(this.panes[0].element, { without: this.missing.length > 0 });
	}

	/** The overlay of a pane: none on a step, and no boxes where the tracker has drawn them. */
	overlayOf({ stream }) {
		if (staysBare(stream, this.panes.map((pane) => pane.stream)) && !this.editor.isActive) {
			return { keys: [], trails: null, shapes: null };
		}
		const keys = topicName(stream) === "tracked" ? [] : this.feed.messages;
		const { trails, shapes, overlayOn } = this.menus;
		const counts = this.frame.items.get(this.feed.messages.find((key) => key.endsWith("/tracks")));
		return { keys, trails: trails ? this.feed.trails : null,
			shapes: (overlayOn && shapes) || this.editor.isActive ? this.editor.marks(counts) : null };
	}

	/** How a pane's values are shown; the first pane's are measured while the menu is open. */
	toneOf(pane) {
		const isMeasured = this.adjust.isOpen && pane === this.panes[0];
		return { choice: this.adjust.of(pane.stream.key), isMeasured };
	}

	/** Return how many of the last frames had all their messages, and why others lacked some. */
	overlayState() {
		const { shown, missing, feed: { joiner, messages } } = this;
		const complete = shown.filter((one) => one.isComplete).length;
		if (!messages.length || (complete === shown.length && !missing.length)) return "";
		const lag = Math.max(...messages.map((key) => joiner.lag(key) ?? -1));
		const wait = 2 * joiner.frameTime;
		const reason = lag > wait
			? ` – they come ${number(lag, 0)} ms after it, it waits ${number(wait, 0)} ms` : "";
		if (complete) return `overlay on ${complete} of ${shown.length} frames${reason}`;
		return `without ${missing.map((key) => key.split("/").at(-1)).join(" and ") || "overlay"}${reason}`;
	}

	tick() {
		if (!this.isOpen || document.hidden) return;
		const { lead, playback: { paused } } = this;
		const live = this.connection.isOpen && !paused && Boolean(lead?.live)
			&& this.feed.isLive(performance.now());
		const text = live || paused || !lead ? "" : this.reason();
		setData(byId("large"), { live, paused });
		setText(byId("large-state"), paused ? "paused" : live ? "live" : "not live");
		byId("unknown").hidden = Boolean(lead);
		for (const pane of this.panes) pane.showState(live, text);
		const { frame, picture, feed: { statistics } } = this;
		writeFigures({ frame, picture, statistics, isAging: paused || live });
	}

	/** Return why the leading stream is not live. */
	reason() {
		const { lead, feed: { statistics } } = this;
		const now = performance.now();
		if (!this.connection.isOpen) return "not connected to the viewer's server";
		if (statistics.isLive(now) && lead.live) return "waiting for a frame with its overlay";
		return statistics.explainSilence(lead, now, this.system.now);
	}
}
