// Vertices as the GPU takes them, declared in core/wasm/packing.h.

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
    const texels = arena.room(8 * count);
    core.check(core.call("mr_pack_vertices", arena.mesh(mesh), arena.put(bounds), texels));
    return arena.u16(texels, 4 * count);
  });
}
