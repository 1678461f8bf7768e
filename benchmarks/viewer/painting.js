// Notes when each numbered picture is painted in this tab: services/zv/camera/synthetic/frame_code.py has
// the code. `selector` names the <img>, or the canvas that shows a 4:3 picture as large as fits.
(selector) => {
	const CHECK = 0xa5;
	const BLOCKS = 8;
	const SIDE = 8; // of a block as it is read, pixels
	const strip = new OffscreenCanvas(BLOCKS * SIDE, SIDE)
		.getContext("2d", { alpha: false, willReadFrequently: true });

	function read() {
		const shown = document.querySelector(selector);
		const [width, height] = shown instanceof HTMLImageElement
			? [shown.naturalWidth, shown.naturalHeight] : [shown?.width, shown?.height];
		if (!width || !height) return null;
		const high = Math.min(height, (width * 3) / 4);
		const wide = (high * 4) / 3;
		const [left, top] = [(width - wide) / 2, (height - high) / 2];
		strip.drawImage(shown, left, top, (wide * BLOCKS) / 20, high / 15, 0, 0, BLOCKS * SIDE, SIDE);
		const { data } = strip.getImageData(0, SIDE / 2, BLOCKS * SIDE, 1);
		let code = 0;
		for (let block = 0; block < BLOCKS; block += 1) {
			const at = 4 * (block * SIDE + SIDE / 2);
			for (const level of data.slice(at, at + 3)) code = (code << 1) | (level > 127 ? 1 : 0);
		}
		const number = code >> 8;
		return (code & 0xff) === ((number >> 8) ^ (number & 0xff) ^ CHECK) ? number : null;
	}

	// A ResizeObserver is called in the same frame after all that was drawn on request, so a page
	// that draws in requestAnimationFrame is read as it is painted, and not one frame later.
	const probe = document.body.appendChild(document.createElement("i"));
	probe.style.cssText = "position: fixed; contain: strict; height: 1px; visibility: hidden";
	window.painted = [];
	window.turns = 0;
	let last = null;
	new ResizeObserver(() => {
		window.turns += 1;
		const number = read();
		// Afterwards: reading makes an <img> decode its picture, which painting would do next.
		const at = performance.timeOrigin + performance.now();
		if (number !== null && number !== last) window.painted.push([number, at]);
		last = number ?? last;
	}).observe(probe);
	const turn = () => {
		probe.style.width = `${1 + (window.turns % 2)}px`;
		requestAnimationFrame(turn);
	};
	turn();
};
