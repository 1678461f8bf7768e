// The bar of a recording that is played, shown while a player says where it is. Its controls change
// parameters of the player.

import { byId, element, listen, setOptions, setText } from "../ui/elements.js";

const TYPE = "vision.Replay.v1";
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const GONE_MS = 3000;
const HELD_MS = 600;
const TINY_S = 1e-6; // so that a jump to the same place is a change

export class ReplayBar {
	constructor(system, watches, connection) {
		this.system = system;
		this.watches = watches;
		this.connection = connection;
		this.state = null;
		this.heldUntil = 0;
		this.at = 0; // when the state was told
		this.tiny = 0;
		this.speeds = new Set(SPEEDS); // and others that it had
		this.receive = ({ body }) => this.draw(body);
		listen("replay-play", "click", () => this.set({ paused: !this.state.paused }));
		listen("replay-step", "click", () => this.set({ paused: true, step: this.state.step + 1 }));
		listen("replay-speed", "change", ({ target }) => this.set({ speed: Number(target.value) }));
		listen("replay-loop", "change", ({ target }) => this.set({ loop: target.checked }));
		listen("replay-position", "input", () => this.hold());
		listen("replay-position", "change", ({ target }) => this.jump(Number(target.value)));
		system.on("streams", () => this.follow());
		setInterval(() => {
			if (this.state && performance.now() - this.at > GONE_MS) this.draw(null);
		}, 1000);
	}

	follow() {
		const found = this.system.streams.find(({ type }) => type === TYPE);
		this.watches.watchMessages(found ? [found.key] : [], this.receive);
		if (!found) this.draw(null);
	}

	set(values) {
		if (!this.state) return;
		Object.assign(this.state, values);
		this.connection.request({ op: "set", node: this.state.node, values });
	}

	hold() {
		this.heldUntil = performance.now() + HELD_MS;
	}

	jump(seconds) {
		this.hold();
		this.tiny = (this.tiny + 1) % 100;
		const most = this.state?.length_s ?? 0;
		this.set({ position: Math.min(seconds, most) + this.tiny * TINY_S });
	}

	draw(state) {
		const bar = byId("replay");
		const before = this.state;
		this.state = state && { ...state };
		this.at = performance.now();
		bar.hidden = !state;
		if (!state) return;
		const { paused, speed, loop, length_s: length, position_s: place, file, marks } = state;
		setText(byId("replay-play"), paused ? "Play" : "Pause");
		setText(byId("replay-file"), file);
		byId("replay-loop").checked = loop;
		const position = byId("replay-position");
		position.max = length;
		if (this.at > this.heldUntil && document.activeElement?.matches(":active") !== true) {
			position.value = place;
		}
		setText(byId("replay-time"), `${seconds(Number(position.value))} / ${seconds(length)}`);
		const choice = byId("replay-speed");
		if (document.activeElement !== choice) {
			this.speeds.add(speed);
			setOptions(choice, [...this.speeds].map((one) => [one, one ? `${one}×` : "fastest"]));
			choice.value = speed;
		}
		if (!before || before.marks.length !== marks.length || before.length_s !== length) {
			byId("replay-marks").replaceChildren(...marks.map((mark) => this.mark(mark, length)));
		}
	}

	mark({ at_s: at, event, zone }, length) {
		const title = `${seconds(at)} ${String(event).replaceAll("_", " ")} ${zone ?? ""}`;
		const made = element("i", { title, onclick: () => this.jump(Math.max(0, at - 1)) });
		made.style.left = `${length ? 100 * at / length : 0}%`;
		return made;
	}
}

/** "1:02.5" */
function seconds(value) {
	const tenths = Math.round(value * 10);
	const rest = (tenths % 600) / 10;
	return `${Math.floor(tenths / 600)}:${rest.toFixed(1).padStart(4, "0")}`;
}
