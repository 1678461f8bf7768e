// The graph of nodes and keys as columns: who publishes, the key, who subscribes.
//
// A node that does both stands on both sides, so the drawing is read like a sentence.

export const ROW = 22;
export const GAP = 12;

/**
 * Lay out nodes ({node, publishes, subscribes, alive}). Returns {rows, senders, receivers, height}:
 * rows [{key, y, sender, receivers}], senders and receivers [{node, y, height}].
 */
export function layOut(nodes) {
	const rows = [];
	const senders = [];
	let y = 0;
	const put = (key, sender) => {
		const receivers = nodes.filter((node) => node.subscribes.some((one) => matches(one, key)))
			.map((node) => node.node);
		rows.push({ key, y, sender, receivers });
		y += ROW;
	};
	for (const node of nodes) {
		if (!node.publishes.length) continue;
		const top = y;
		for (const key of node.publishes) put(key, node.node);
		senders.push({ node: node.node, y: top, height: y - top });
		y += GAP;
	}
	const published = nodes.flatMap((node) => node.publishes);
	const unsent = new Set(nodes.flatMap((node) => node.subscribes)
		.filter((wanted) => !published.some((key) => matches(wanted, key))));
	for (const key of unsent) put(key, null);
	return { rows, senders, receivers: beside(nodes, rows, y), height: Math.max(0, y) };
}

/** Put each subscriber at the middle of its keys, in order, none over another. */
function beside(nodes, rows, height) {
	const wanted = nodes.filter((node) => rows.some((row) => row.receivers.includes(node.node)))
		.map((node) => {
			const own = rows.filter((row) => row.receivers.includes(node.node));
			return { node: node.node, y: own.reduce((sum, row) => sum + row.y, 0) / own.length };
		})
		.sort((a, b) => a.y - b.y);
	let least = 0;
	for (const one of wanted) {
		one.height = ROW;
		one.y = Math.max(least, one.y);
		least = one.y + ROW + 6;
	}
	const over = Math.max(0, least - 6 - height);
	return wanted.map((one) => ({ ...one, y: Math.max(0, one.y - over) }));
}

/** Tell whether a key expression with `*` and `**` matches a key. */
export function matches(expression, key) {
	const pattern = expression.replace(/[.+?^${}()|[\]\\]/g, "\\$&").split("/").map((chunk) =>
		({ "**": "(?:/[^@/][^/]*)*", "*": "/[^@/][^/]*" })[chunk] ?? `/${chunk}`).join("");
	return new RegExp(`^${pattern}$`).test(`/${key}`);
}
