// Who wants to be told of what.

export class Events {
	constructor() {
		this.listeners = new Map();
	}

	/** Call `listener` with each `name`; returns a function that ends it. */
	on(name, listener) {
		if (!this.listeners.has(name)) this.listeners.set(name, new Set());
		this.listeners.get(name).add(listener);
		return () => this.listeners.get(name).delete(listener);
	}

	emit(name, fact) {
		for (const listener of this.listeners.get(name) ?? []) listener(fact);
	}
}
