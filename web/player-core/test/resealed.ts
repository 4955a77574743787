// A file whose bytes were changed, with checksums that fit them: damage that only what they are decoded with can find.

import { crc32 } from "../src/format/crc.ts";
import { Head } from "../src/format/reader.ts";
import type { Chunk } from "../src/format/reader.ts";

/** A copy of a file in which the bytes of some chunks are changed. */
export function resealed(file: Uint8Array, chunks: readonly Chunk[], change: (payload: Uint8Array) => void): Uint8Array<ArrayBuffer> {
  const copy = Uint8Array.from(file);
  const head = copy.subarray(0, Head.sizeOf(file));
  for (const { offset, layers } of chunks) {
    let at = offset;
    for (const { size, crc } of layers) {
      const payload = copy.subarray(at, (at += size));
      change(payload);
      put(head, placeOf(head, crc), crc32(payload));
    }
  }
  put(head, head.length - 4, crc32(head.subarray(0, -4)));
  return copy;
}

function placeOf(head: Uint8Array, crc: number): number {
  const view = new DataView(head.buffer, head.byteOffset, head.length);
  for (let at = 0; at + 4 <= head.length; at++) if (view.getUint32(at, true) === crc) return at;
  throw new Error(`no checksum ${crc} in the head`);
}

function put(bytes: Uint8Array, at: number, value: number): void {
  new DataView(bytes.buffer, bytes.byteOffset).setUint32(at, value, true);
}
