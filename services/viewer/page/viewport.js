// Zoom and pan as arithmetic. A view is {scale, x, y}: device pixels per frame pixel, and the
// frame's point at the middle of the pane. All sizes are {width, height}.

const LARGEST_SCALE = 64;

export function fitScale(frame, pane) {
	return Math.min(pane.width / frame.width, pane.height / frame.height);
}

export function fit(frame, pane) {
	return { scale: fitScale(frame, pane), x: frame.width / 2, y: frame.height / 2 };
}

/** Where a point of the frame is in the pane, device pixels. */
export function toPane(view, pane, point) {
	return {
		x: (point.x - view.x) * view.scale + pane.width / 2,
		y: (point.y - view.y) * view.scale + pane.height / 2,
	};
}

export function toFrame(view, pane, point) {
	return {
		x: (point.x - pane.width / 2) / view.scale + view.x,
		y: (point.y - pane.height / 2) / view.scale + view.y,
	};
}

/** The view zoomed by a factor; the point of the frame under `at` (of the pane) stays there. */
export function zoomed(view, frame, pane, factor, at) {
	const least = Math.min(fitScale(frame, pane), 1) / 2;
	const scale = Math.min(LARGEST_SCALE, Math.max(least, view.scale * factor));
	const held = toFrame(view, pane, at);
	const x = held.x - (at.x - pane.width / 2) / scale;
	const y = held.y - (at.y - pane.height / 2) / scale;
	return within({ scale, x, y }, frame);
}

export function panned(view, frame, dx, dy) {
	return within({ ...view, x: view.x - dx / view.scale, y: view.y - dy / view.scale }, frame);
}

/** The view with its middle inside the frame, so that the frame cannot be lost. */
function within(view, frame) {
	return {
		scale: view.scale,
		x: Math.min(frame.width, Math.max(0, view.x)),
		y: Math.min(frame.height, Math.max(0, view.y)),
	};
}
