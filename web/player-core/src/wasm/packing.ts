// Vertices as the GPU takes them, as core/wasm/packing.h has it.

import { FormatError } from "../errors.ts";
import type { Mesh } from "../mesh.ts";
import type { Core } from "./memory.ts";

/** Three lower, then three upper bounds. */
export type Bounds = Float64Array;

export function noBounds(): Bounds {
  return new Float64Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
}

/** Bounds that hold these places, too. */
export function growBox(core: Core, positions: Float64Array, bounds: Bounds): Bounds {
  return core.run((arena) => {
    const box = arena.put(bounds);
    core.call("mr_grow_box", arena.put(positions), positions.length / 3, box);
    return arena.f64(box, 6);
  });
}

/** Four numbers a vertex: x, y and z in 65535ths of the bounds, and an octahedral normal. */
export function packVertices(core: Core, mesh: Mesh, bounds: Bounds): Uint16Array {
  const count = mesh.vertices.length / 3;
  return core.run((arena) => {
    const positions = arena.put(mesh.vertices);
    const sums = arena.room(24 * count);
    const status = core.call("mr_normal_sums", positions, count, arena.put(mesh.faces), mesh.faces.length / 3, sums);
    if (status !== 0) throw new FormatError(`a face that names none of ${count} vertices`);
    const texels = arena.room(8 * count);
    core.call("mr_pack_vertices", positions, sums, count, arena.put(bounds), texels);
    return arena.u16(texels, 4 * count);
  });
}
