// Arrays of bytes.

import type { Packed } from "./types.ts";

/** All pieces, one behind the other. */
export function joined(pieces: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    all.set(piece, at);
    at += piece.length;
  }
  return all;
}

/** All arrays of a packed value. */
export function arraysOf(packed: Packed): readonly (Uint8Array | Uint16Array | Uint32Array)[] {
  const { texels, colors, faces, places } = packed;
  const single = packed.kind === "static" ? [] : [packed.extra, packed.extraStarts, packed.splats?.words];
  return [texels, colors, faces, places?.faces, places?.extra, ...single].filter((array) => !!array);
}

/** Bytes that a packed value takes. */
export function bytesOf(packed: Packed): number {
  return arraysOf(packed).reduce((sum, { byteLength }) => sum + byteLength, 0);
}
