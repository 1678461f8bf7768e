// The large view: streams side by side, those of one camera always of the same frame, the overlay,
// and below it age, rate, losses, size and frame number of the first stream, which leads.

import { saveDrawn, saveOriginal } from "../export/saving.js";
import { pictureStreams, staysBare, stepKeys, topicName } from "../model/streams.js";
import { watchOptions } from "../model/transfer.js";
import { between, milliseconds } from "../transport/connection.js";
import { byId, setData, setText } from "../ui/elements.js";
import { clock, count, duration, number, pictureSize, shownRate, size } from "../ui/format.js";
import { Adjust } from "./adjust.js";
import { CameraFrames } from "./camera_frames.js";
import { Menus, transferMenu } from "./menus.js";
import { PaneGrid } from "./pane_grid.js";
import { ShapeEditor } from "./shape_editor.js";

const TICK_MS = 200;
const ITS_MENUS = '.tools [popovertarget]:not([popovertarget="layout-menu"])';
const BARE = { keys: [], trails: null, shapes: null };

export class Inspector {
	/**
	 * `go(keys, part)` shows other streams, in a layout with this part changed. `orientations` and
	 * `transfer` are the page's choices for the streams; `setTransfer(choice)` changes `transfer`
	 * for all of them.
	 */
	constructor(system, watches, connection, go, { orientations, transfer, setTransfer }) {
		this.system = system;
		this.watches = watches;
		this.connection = connection;
		this.go = go;
		this.transfer = transfer;
		this.keys = [];
		this.lead = null;
		this.paused = false;
		this.cameras = new Map(); // name of a group of streams -> their CameraFrames
		this.apart = new Set(); // keys of streams whose frames are not those of their camera
		const follow = () => this.follow();
		this.menus = new Menus(system, follow, go);
		this.adjust = new Adjust(orientations, follow);
		this.transferMenu = transferMenu(transfer, setTransfer, follow);
		this.editor = new ShapeEditor(system, connection, () => this.grid?.requestPaint());
		this.grid = new PaneGrid({
			orientationOf: (camera) => orientations.of(camera),
			lookOf: (pane) => ({ overlay: this.overlayOf(pane), tone: this.toneOf(pane) }),
			painted: () => this.painted(),
			editor: this.editor,
		});
		const { grid } = this;
		this.commands = { // of keys and buttons; some take an argument
			togglePause: () => this.setPaused(!this.paused),
			step: (by) => this.step(by),
			fit: () => grid.fit(),
			actual: () => grid.actual(),
			zoom: (factor) => grid.zoom(factor),
			toggleOverlay: () => this.menus.set("overlayOn", !this.menus.overlayOn),
			editShapes: () => this.editor.toggle(),
			showSteps: () => go(stepKeys(system.streams, this.camera), { panel: "parameters" }),
			neighbour: (by) => this.showNeighbour(by),
			turn: (how) => this.lead && this.adjust.turn(how),
			stretch: () => this.lead && this.adjust.toggleStretch(),
			copyAddress: () => this.lead && this.transferMenu.copyAddress(),
			fullScreen: () => (document.fullscreenElement ? document.exitFullscreen()
				: byId("large").requestFullscreen?.()),
			save: () => this.picture && saveOriginal(this.frame, this.lead),
			saveDrawn: () => this.saveDrawn(),
		};
		system.on("streams", () => this.isOpen && this.follow());
		connection.on("close", () => {
			for (const one of this.cameras.values()) one.lastFrameAt = null;
		});
		setInterval(() => this.tick(), TICK_MS);
	}

	get isOpen() {
		return this.keys.length > 0;
	}

	get camera() {
		return this.lead?.camera ?? null;
	}

	/** The frames of the leading stream. */
	get frames() {
		return this.grid.panes[0]?.frames;
	}

	get frame() {
		return this.frames?.frame ?? null;
	}

	/** The leading picture of the current frame, as received. */
	get picture() {
		return this.frame?.items.get(this.lead?.key)?.picture;
	}

	open(keys) {
		if (keys[0] !== this.keys[0]) this.reset();
		this.keys = keys;
		this.follow();
	}

	close() {
		this.keys = [];
		this.editor.follow(null);
		this.reset();
	}

	reset() {
		this.grid.setPanes([]);
		for (const frames of this.cameras.values()) frames.close();
		this.cameras.clear();
		this.apart.clear();
		this.lead = null;
		this.grid.pointer = null;
		this.grid.fit();
		this.setPaused(false);
	}

	setPaused(paused) {
		this.paused = paused;
		for (const frames of this.cameras.values()) frames.setPaused(paused);
		if (paused) this.align();
		byId("pause").setAttribute("aria-pressed", String(paused));
		this.grid.requestPaint(); // what is written on a picture may differ, also without a new one
		this.tick();
	}

	/** Show the frames of the other cameras that were captured nearest to that of the first one. */
	align() {
		const header = this.frames?.playback.header;
		for (const { playback } of this.cameras.values()) {
			if (header && playback !== this.frames.playback) playback.showNearest(header);
		}
	}

	/** Pause, and show the frame before (-1) or after (1); of other cameras, the nearest to it. */
	step(by) {
		if (!this.paused) this.setPaused(true);
		const playback = this.frames?.playback;
		if (!playback) return;
		if (by > 0 && playback.isAtEnd) for (const one of this.cameras.values()) one.next();
		else {
			playback.step(by);
			this.align();
		}
	}

	saveDrawn() {
		if (!this.picture) return;
		this.grid.paint(); // a new frame may not be painted yet
		const [pane] = this.grid.panes;
		saveDrawn(this.frame, this.lead, this.overlayOf(pane), pane.toner.made.image);
	}

	/** Show the next stream of the wall's order (1), or the one before (-1). */
	showNeighbour(by) {
		const all = pictureStreams(this.system.streams);
		const at = all.findIndex((stream) => stream.key === this.keys[0]);
		if (all.length) this.go([all[(at + by + all.length) % all.length].key]);
	}

	/** Follow the chosen streams that exist; the first of them leads. */
	follow() {
		const streams = this.keys.map((key) => this.system.stream(key)).filter(Boolean);
		this.lead = streams[0] ?? null;
		setText(byId("large-camera"), this.lead?.camera ?? "");
		setText(byId("large-topic"), this.lead ? topicName(this.lead) : this.keys[0]);
		byId("steps").hidden = !stepKeys(this.system.streams, this.camera).length;
		for (const button of byId("large").querySelectorAll(ITS_MENUS)) button.disabled = !this.lead;
		if (!this.lead) return;
		this.menus.write(this.keys, this.lead);
		byId("overlay-toggle").setAttribute("aria-pressed", String(this.menus.overlayOn));
		this.adjust.follow(this.lead);
		this.editor.follow(this.camera);
		this.followCameras(streams);
		this.transferMenu.follow(this.lead, this.frame?.header);
		this.grid.turnTo(this.adjust.orientation);
		this.grid.requestPaint();
	}

	/** Follow the streams of each camera together. */
	followCameras(streams) {
		for (const key of this.apart) if (!streams.some((one) => one.key === key)) this.apart.delete(key);
		const nameOf = ({ key, camera }) => (this.apart.has(key) ? key : camera);
		const groups = Map.groupBy(streams, nameOf);
		for (const [name, frames] of this.cameras) {
			if (groups.has(name)) continue;
			frames.close();
			this.cameras.delete(name);
		}
		const optionsOf = (key) => ({ ...watchOptions(this.transfer.of(key)), values: true });
		for (const [name, own] of groups) {
			const frames = this.cameras.get(name)
				?? new CameraFrames(this.watches, this.paused, (one) => this.display(one));
			this.cameras.set(name, frames);
			const messages = this.apart.has(name) ? [] : this.menus.overlayKeys(own[0].camera);
			frames.follow(own.map(({ key }) => key), messages, optionsOf, this.menus.onlyComplete);
		}
		this.grid.setPanes(streams, (stream) => this.cameras.get(nameOf(stream)));
	}

	display(frames) {
		for (const pane of this.grid.panes) if (pane.frames === frames) pane.take();
		this.grid.requestPaint();
	}

	painted() {
		if (this.grid.panes[0].item) this.adjust.draw(this.grid.panes[0].toner.made);
		for (const pane of this.grid.panes) setText(pane.apart, this.apartness(pane));
		for (const frames of this.cameras.values()) {
			const pane = this.grid.panes.find((one) => one.frames === frames);
			if (!frames.frame) continue;
			setText(pane.badge, frames.overlayState());
			setData(pane.element, { without: frames.missing.length > 0 });
		}
	}

	/** How much later than the first camera's frame that of a pane was captured; while paused. */
	apartness({ frames, frame }) {
		if (!this.paused || frames === this.frames || !frame || !this.frame) return "";
		const later = between(this.frame.header.stamp_ns, frame.header.stamp_ns);
		return `${later < 0 ? "−" : "+"}${number(Math.abs(later), 1)} ms`;
	}

	/** The overlay of a pane: none on a step, and no boxes where the tracker has drawn them. */
	overlayOf({ stream, frames: { frame, messages, trails } }) {
		const isEdited = this.editor.isActive && stream.camera === this.camera;
		const beside = this.grid.panes.map((pane) => pane.stream)
			.filter(({ camera }) => camera === stream.camera);
		if (staysBare(stream, beside) && !isEdited) return BARE;
		const hasShapes = stream.camera === this.camera && this.menus.overlayOn && this.menus.shapes;
		const counts = frame.items.get(messages.find((key) => key.endsWith("/tracks")));
		return { keys: topicName(stream) === "tracked" ? [] : messages,
			trails: this.menus.trails ? trails : null,
			shapes: hasShapes || isEdited ? this.editor.marks(counts) : null };
	}

	/** How a pane's values are shown; the first pane's are measured while the menu is open. */
	toneOf(pane) {
		const isMeasured = this.adjust.isOpen && pane === this.grid.panes[0];
		return { choice: this.adjust.of(pane.stream.key), isMeasured };
	}

	tick() {
		if (!this.isOpen || document.hidden) return;
		const { lead, paused, frame, picture } = this;
		const now = performance.now();
		for (const { joiner } of this.cameras.values()) {
			for (const key of joiner.strangers(now)) this.apart.add(key);
		}
		if ([...this.apart].some((key) => !this.cameras.has(key))) this.follow();
		const isLive = ({ stream, frames }) => this.connection.isOpen && !paused && stream.live
			&& frames.isLive(now);
		for (const pane of this.grid.panes) {
			const live = isLive(pane);
			for (const one of [pane.element, pane.picture]) setData(one, { live });
			setText(pane.state, live || paused ? "" : this.reason(pane, now));
		}
		const live = Boolean(lead) && isLive(this.grid.panes[0]);
		setData(byId("large"), { live, paused });
		setText(byId("large-state"), paused ? "paused" : live ? "live" : "not live");
		byId("unknown").hidden = Boolean(lead);
		writeFigures({ frame, picture, statistics: this.frames?.statistics, isAging: paused || live });
	}

	/** Return why the stream of a pane is not live. */
	reason({ stream, frames: { statistics } }, now) {
		if (!this.connection.isOpen) return "not connected to the viewer's server";
		if (statistics.isLive(now) && stream.live) return "waiting for a frame with its overlay";
		return statistics.explainSilence(stream, now, this.system.now);
	}
}

/** Write figures of a frame and its picture, both perhaps absent; the age grows if `isAging`. */
function writeFigures({ frame, picture, statistics, isAging }) {
	const now = performance.now();
	const stamp = frame && milliseconds(frame.header.stamp_ns); // by the camera's clock
	const texts = {
		age: duration(picture && isAging ? picture.ageMs + now - picture.at : null),
		rate: shownRate(statistics?.arrivalRate(now) ?? null, statistics?.rate(now) ?? null),
		lost: picture ? count(statistics.lost) : "–",
		skipped: picture ? count(statistics.skipped) : "–",
		size: picture ? `${pictureSize(picture)} · ${size(picture.data.byteLength)}` : "–",
		frame: frame ? String(frame.seq) : "–",
		time: frame ? `${clock(stamp)}.${String(Math.floor(stamp % 1000)).padStart(3, "0")}` : "–",
	};
	for (const [name, text] of Object.entries(texts)) setText(byId(`figure-${name}`), text);
	byId("figure-frame").title = frame ? `epoch ${frame.epoch}` : "";
}
