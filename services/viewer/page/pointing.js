// Mouse, pen and fingers on a pane, as moves, drags and zooms in its device pixels.

const WHEEL_STEP = 0.0015;

/**
 * Listen on an element. `tell` has: moved(point or null), dragged(dx, dy), zoomed(factor, point),
 * doubled(point).
 */
export function listenToPointer(target, tell) {
	const down = new Map();
	const ratio = () => devicePixelRatio || 1;
	const place = (event) => {
		const box = target.getBoundingClientRect();
		return { x: (event.clientX - box.left) * ratio(), y: (event.clientY - box.top) * ratio() };
	};

	target.addEventListener("pointerdown", (event) => {
		if (event.button > 0) return;
		down.set(event.pointerId, place(event));
		target.setPointerCapture(event.pointerId);
	});
	target.addEventListener("pointermove", (event) => {
		const at = place(event);
		tell.moved(at);
		const before = down.get(event.pointerId);
		if (!before) return;
		if (down.size === 2) pinch(event.pointerId, at);
		else tell.dragged(at.x - before.x, at.y - before.y);
		down.set(event.pointerId, at);
	});
	for (const name of ["pointerup", "pointercancel"]) {
		target.addEventListener(name, (event) => down.delete(event.pointerId));
	}
	target.addEventListener("pointerleave", (event) => {
		if (event.pointerType === "mouse") tell.moved(null);
	});
	target.addEventListener("wheel", (event) => {
		event.preventDefault();
		tell.zoomed(Math.exp(-event.deltaY * WHEEL_STEP), place(event));
	}, { passive: false });
	target.addEventListener("dblclick", (event) => tell.doubled(place(event)));

	function pinch(moving, at) {
		const [other] = [...down].filter(([id]) => id !== moving).map(([, point]) => point);
		const before = down.get(moving);
		const distance = (a, b) => Math.max(1, Math.hypot(a.x - b.x, a.y - b.y));
		const middle = { x: (at.x + other.x) / 2, y: (at.y + other.y) / 2 };
		tell.zoomed(distance(at, other) / distance(before, other), middle);
		tell.dragged((at.x - before.x) / 2, (at.y - before.y) / 2);
	}
}
