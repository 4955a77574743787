// Entropy decoding, declared in core/include/meshreel/entropy.h. A damaged stream is null, or the number of its column.

import { joined } from "../bytes.ts";
import type { Arena, Core } from "./memory.ts";

/** For each of `starts.length - 1` values the earlier ones that it is near: near[starts[v]] up to near[starts[v + 1]]. */
export interface Neighbours {
  readonly starts: BigInt64Array;
  readonly near: Int32Array;
}

export function decodeIntegers(core: Core, data: Uint8Array, count: number): Int32Array | null {
  return core.run((arena) => {
    const values = arena.room(4 * count);
    const status = core.call("mr_decode_integers", arena.put(data), data.length, count, values);
    return status === 0 ? arena.i32(values, count) : null;
  });
}

/** The symbols of all columns, column after column, or the number of the one that is damaged. */
export function decodeWeights(core: Core, streams: readonly Uint8Array[], count: number, neighbours: Neighbours): Int32Array | number {
  return core.run((arena) => {
    const sizes = arena.put(Int32Array.from(streams, (stream) => stream.length));
    const [symbols, weights] = weightsOf(arena, streams.length, count, neighbours);
    const failed = arena.struct(["u32", 0]);
    const status = core.call("mr_decode_weights", weights, arena.put(joined(streams)), sizes, failed);
    return status === 0 ? arena.i32(symbols, count * streams.length) : arena.u32(failed);
  });
}

/** Room for symbols, and a struct mr_weights around it. */
function weightsOf(arena: Arena, columns: number, count: number, neighbours: Neighbours): [number, number] {
  const symbols = arena.room(4 * columns * count);
  const [starts, near] = [arena.put(neighbours.starts), arena.put(neighbours.near)];
  const struct = arena.struct(
    ["u32", symbols],
    ["u32", count],
    ["u32", columns],
    ["u32", starts],
    ["u32", near],
    ["u32", neighbours.near.length],
  );
  return [symbols, struct];
}
