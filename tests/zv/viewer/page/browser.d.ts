// What browsers have and Debian's TypeScript does not know yet.
declare var OffscreenCanvas: any;
declare var CompressionStream: any;
declare var uPlot: any; // vendor/uplot.js
interface MapConstructor { groupBy(items: Iterable<any>, key: (item: any) => any): Map<any, any[]>; }
interface Array<T> { findLast(is: (item: T) => unknown): T | undefined; }
interface Element { checkVisibility(): boolean; }
interface Event { newState: string; }

// Any kind of element, of which a handler or a list of elements knows the properties.
interface EventTarget { value: any; checked: any; blur(): void; }
interface Element { readonly dataset: DOMStringMap; }
interface Event { detail: any; }
