// Entropy coding with its claims checked before memory is taken. Beside coding/entropy.py.

import { FormatError } from "../errors.ts";
import { decodeIntegers as decode } from "../wasm/entropy.ts";
import type { Neighbours } from "../wasm/entropy.ts";
import { subdivide } from "../wasm/layers.ts";
import type { Core } from "../wasm/memory.ts";

const SYMBOLS_PER_BYTE = 22_800; // bound: a coded bit costs at least 1 / 2840 bit (coding/entropy.py)

/** The `count` values; FormatError where `data` is not exactly their stream. */
export function decodeIntegers(core: Core, data: Uint8Array, count: number): Int32Array {
  checkPlausible(count, data.length, "integers");
  const values = decode(core, data, count);
  if (values === null) throw new FormatError(`integers: ${data.length} bytes are not a stream of ${count} values; truncated or damaged`);
  return values;
}

/** Refuses a claim of more symbols than `size` bytes can say. */
export function checkPlausible(count: number, size: number, what: string): void {
  if (!(count <= SYMBOLS_PER_BYTE * (size + 4)) || count > 0 !== size > 0) {
    throw new FormatError(`${what}: ${count} symbols cannot come from ${size} bytes; the stream is damaged`);
  }
}

/** For each of `count` vertices its mesh neighbours with a smaller index, sorted. */
export function causalNeighbours(core: Core, faces: Int32Array, count: number): Neighbours {
  const { edges } = subdivide(core, faces, count); // sorted by the smaller end: stable by the larger one, both are
  const starts = new Int32Array(count + 1);
  const isEdge = (e: number): boolean => edges[2 * e] !== edges[2 * e + 1]; // a face may name a vertex twice
  const edgeCount = edges.length / 2;
  for (let e = 0; e < edgeCount; e++) if (isEdge(e)) starts[edges[2 * e + 1] + 1] += 1;
  for (let v = 0; v < count; v++) starts[v + 1] += starts[v];
  const near = new Int32Array(starts[count]);
  const next = starts.slice();
  for (let e = 0; e < edgeCount; e++) if (isEdge(e)) near[next[edges[2 * e + 1]]++] = edges[2 * e];
  return { starts: BigInt64Array.from(starts, BigInt), near };
}
