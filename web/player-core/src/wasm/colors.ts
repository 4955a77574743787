// Colours of vertices, declared in core/include/meshreel/colors.h.

import type { Mesh } from "../mesh.ts";
import type { Core } from "./memory.ts";

/** A mesh whose vertices, after `levels` subdivisions, have colours in `frames` frames. */
export interface ColoredMesh {
  readonly base: Mesh;
  readonly levels: number;
  readonly frames: number; // T
  readonly vertices: number; // V, after the subdivisions
}

/** Values in the last frame before, three a vertex, and what colour differences were multiplied by. */
export interface ColorContext {
  readonly chroma: number;
  readonly before: Float64Array | null;
}

/** T x V x 3 bytes of red, green and blue, and the values of the last frame. FormatError where the records are damaged. */
export function decodeMeshColors(core: Core, records: Uint8Array, mesh: ColoredMesh, { chroma, before }: ColorContext): [Uint8Array, Float64Array] {
  const { base, levels, frames, vertices } = mesh;
  const [size, values] = [3 * frames * vertices, 3 * vertices];
  return core.run((arena) => {
    const [colors, last] = [arena.room(size), arena.room(8 * values)];
    const known = before === null ? 0 : arena.put(before);
    const counts = [["i32", levels], ["u32", vertices], ["u32", frames]] as const;
    const colored = arena.struct(["u32", arena.mesh(base)], ...counts, ["f64", chroma], ["u32", known]);
    core.check(core.call("mr_decode_colors", colored, arena.record(records), colors, last), "colours: ");
    return [arena.bytes(colors, size), arena.f64(last, values)];
  });
}
