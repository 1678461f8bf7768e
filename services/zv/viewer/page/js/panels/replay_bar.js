// The bar of a recording that is played, shown while a player says where it is. Its controls change
// parameters of the player.

import { byId, drawList, element, listen, setOptions, setText } from "../ui/elements.js";

const TYPE = "vision.Replay.v1";
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const GONE_MS = 3000;
const HELD_MS = 600;
const TINY_S = 1e-6; // so that a jump to the same place is a change

export function showReplay(system, watches, connection) {
	/** @type {any} */
	let state = null; // as the player told it, or was asked to change it
	let toldAt = 0;
	let heldUntil = 0;
	let jumps = 0;
	const speeds = new Set(SPEEDS); // and others that it had

	function set(values) {
		if (!state) return;
		Object.assign(state, values);
		connection.request({ op: "set", node: state.node, values });
	}

	function hold() {
		heldUntil = performance.now() + HELD_MS;
	}

	function jump(place) {
		hold();
		jumps = (jumps + 1) % 100;
		set({ position: Math.min(place, state?.length_s ?? 0) + jumps * TINY_S });
	}

	function draw(told) {
		state = told && { ...told };
		toldAt = performance.now();
		byId("replay").hidden = !told;
		if (!told) return;
		const { paused, speed, loop, length_s: length, position_s: place, file, marks } = told;
		setText(byId("replay-play"), paused ? "Play" : "Pause");
		setText(byId("replay-file"), file);
		byId("replay-loop").checked = loop;
		const position = byId("replay-position");
		position.max = length;
		if (toldAt > heldUntil && document.activeElement?.matches(":active") !== true) {
			position.value = place;
		}
		setText(byId("replay-time"), `${seconds(Number(position.value))} / ${seconds(length)}`);
		const choice = byId("replay-speed");
		if (document.activeElement !== choice) {
			speeds.add(speed);
			setOptions(choice, [...speeds].map((one) => [one, one ? `${one}×` : "fastest"]));
			choice.value = speed;
		}
		const keyed = marks.map((mark) => ({ ...mark, length, key: JSON.stringify([mark, length]) }));
		drawList(byId("replay-marks"), keyed, makeMark);
	}

	function makeMark({ at_s: at, event, zone, length }) {
		const title = `${seconds(at)} ${String(event).replaceAll("_", " ")} ${zone ?? ""}`;
		const mark = element("i", { title, onclick: () => jump(Math.max(0, at - 1)) });
		mark.style.left = `${length ? 100 * at / length : 0}%`;
		return { element: mark };
	}

	const receive = ({ body }) => draw(body);
	listen("replay-play", "click", () => set({ paused: !state.paused }));
	listen("replay-step", "click", () => set({ paused: true, step: state.step + 1 }));
	listen("replay-speed", "change", ({ target }) => set({ speed: Number(target.value) }));
	listen("replay-loop", "change", ({ target }) => set({ loop: target.checked }));
	listen("replay-position", "input", hold);
	listen("replay-position", "change", ({ target }) => jump(Number(target.value)));
	system.on("streams", () => {
		const found = system.streams.find(({ type }) => type === TYPE);
		watches.watchMessages(found ? [found.key] : [], receive);
		if (!found) draw(null);
	});
	setInterval(() => {
		if (state && performance.now() - toldAt > GONE_MS) draw(null);
	}, 1000);
}

/** "1:02.5" */
function seconds(value) {
	const tenths = Math.round(value * 10);
	const rest = (tenths % 600) / 10;
	return `${Math.floor(tenths / 600)}:${rest.toFixed(1).padStart(4, "0")}`;
}
