// Places of corners in a texture, declared in core/include/meshreel/places.h.

import type { Mesh } from "../mesh.ts";
import type { Core } from "./memory.ts";

/** What places are coded as. */
export interface PlaceSymbols {
  readonly joins: Int32Array;
  readonly starts: Int32Array;
  readonly rests: Int32Array;
}

/** Two whole texels, right and down, of each of the three corners of each face. FormatError where the symbols are not those of this mesh. */
export function decodePlaces(core: Core, mesh: Mesh, { joins, starts, rests }: PlaceSymbols): Int32Array {
  const count = 2 * mesh.faces.length;
  return core.run((arena) => {
    const places = arena.room(4 * count);
    const streams = [joins, starts, rests].map((stream) => arena.put(stream));
    const symbols = arena.struct(...[...streams, joins.length, starts.length, rests.length].map((value) => ["u32", value] as const));
    core.check(core.call("mr_decode_places", arena.mesh(mesh), symbols, places), "an atlas: ");
    return arena.i32(places, count);
  });
}
