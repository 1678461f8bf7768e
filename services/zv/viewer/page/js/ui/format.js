// Formats numbers as text: few digits, always with their unit; "–" for unknown values.

const UNKNOWN = "–";

export function duration(ms) {
	if (ms === null || ms === undefined || Number.isNaN(ms)) return UNKNOWN;
	if (ms < 0) return `-${duration(-ms)}`;
	if (ms < 1000) return `${Math.round(ms)} ms`;
	if (ms < 10_000) return `${(ms / 1000).toFixed(1)} s`;
	const seconds = Math.round(ms / 1000);
	if (seconds < 60) return `${seconds} s`;
	const minutes = Math.floor(seconds / 60);
	if (minutes < 60) return `${minutes} min ${seconds % 60} s`;
	const hours = Math.floor(minutes / 60);
	if (hours < 24) return `${hours} h ${String(minutes % 60).padStart(2, "0")} min`;
	return `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

export function rate(hz) {
	if (hz === null || hz === undefined) return UNKNOWN;
	if (hz >= 100) return `${Math.round(hz)} Hz`;
	return `${hz.toFixed(hz < 1 && hz > 0 ? 2 : 1)} Hz`;
}

const CLEARLY_FEWER = 0.8;

/** The rate of a stream; "1.3 of 8.0 Hz" if clearly fewer pictures a second arrive here. */
export function shownRate(arriving, all) {
	const isLess = arriving !== null && all !== null && arriving < CLEARLY_FEWER * all;
	return isLess ? `${rate(arriving).replace(" Hz", "")} of ${rate(all)}` : rate(all);
}

/** "1 240", with thin spaces, so that long counters can be read. */
export function count(number) {
	return String(number).replace(/\B(?=(\d{3})+(?!\d))/g, "\u2009");
}

export function size(bytes) {
	if (bytes < 1000) return `${bytes} B`;
	if (bytes < 1_000_000) return `${(bytes / 1000).toFixed(bytes < 10_000 ? 1 : 0)} kB`;
	return `${(bytes / 1_000_000).toFixed(1)} MB`;
}

/** "0.9 Mbit/s" */
export function bitRate(bitsPerSecond) {
	return bitsPerSecond < 100_000 ? `${Math.round(bitsPerSecond / 1000)} kbit/s`
		: `${(bitsPerSecond / 1_000_000).toFixed(1)} Mbit/s`;
}

/** "14:03:22" in this browser's time zone, from milliseconds since 1970. */
export function clock(ms) {
	return ms === null ? UNKNOWN : new Date(ms).toTimeString().slice(0, 8);
}

/** The clock, after the day if that is not today. */
export function dayAndClock(ms) {
	const day = new Date(ms).toLocaleDateString();
	return day === new Date().toLocaleDateString() ? clock(ms) : `${day} ${clock(ms)}`;
}

/** A number with as many digits as it needs, at most `digits` after the point. */
export function number(value, digits = 3) {
	return value === null || value === undefined ? UNKNOWN : String(Number(value.toFixed(digits)));
}

/** "640×480", or "640×480 as 320×240" of a picture that was made smaller than its frame. */
export function pictureSize({ header, width, height }) {
	const full = `${header.width}×${header.height}`;
	return width < header.width ? `${full} as ${width}×${height}` : full;
}
