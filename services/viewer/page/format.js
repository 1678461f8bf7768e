// Figures as text: few digits, always with their unit.

export function duration(ms) {
	if (ms === null || ms === undefined || Number.isNaN(ms)) return "–";
	if (ms < 0) return `-${duration(-ms)}`;
	if (ms < 1000) return `${Math.round(ms)} ms`;
	if (ms < 10_000) return `${(ms / 1000).toFixed(1)} s`;
	const seconds = Math.round(ms / 1000);
	if (seconds < 60) return `${seconds} s`;
	const minutes = Math.floor(seconds / 60);
	if (minutes < 60) return `${minutes} min ${seconds % 60} s`;
	const two = (number) => String(number).padStart(2, "0");
	if (minutes < 1440) return `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min`;
	return `${Math.floor(minutes / 1440)} d ${Math.floor(minutes / 60) % 24} h`;
}

export function rate(hz) {
	if (hz === null || hz === undefined) return "–";
	if (hz >= 100) return `${Math.round(hz)} Hz`;
	return `${hz.toFixed(hz < 1 && hz > 0 ? 2 : 1)} Hz`;
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

/** "14:03:22" of this browser's day, from milliseconds since 1970. */
export function clock(ms) {
	if (ms === null) return "–";
	const date = new Date(ms);
	return [date.getHours(), date.getMinutes(), date.getSeconds()]
		.map((number) => String(number).padStart(2, "0"))
		.join(":");
}

/** A number with as many digits as it needs, at most `digits` behind the point. */
export function number(value, digits = 3) {
	return String(Number(value.toFixed(digits)));
}
