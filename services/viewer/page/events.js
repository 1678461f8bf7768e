// Who wants to be told of what.

export class Events {
  constructor() {
    this._listeners = new Map();
  }

  /** Call `listener` with each `name`; returns a function that ends it. */
  on(name, listener) {
    if (!this._listeners.has(name)) this._listeners.set(name, new Set());
    this._listeners.get(name).add(listener);
    return () => this._listeners.get(name).delete(listener);
  }

  emit(name, fact) {
    for (const listener of this._listeners.get(name) ?? []) listener(fact);
  }
}
