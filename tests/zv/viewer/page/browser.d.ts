// What browsers have and Debian's TypeScript does not know yet.
declare var OffscreenCanvas: any;
declare var CompressionStream: any;
