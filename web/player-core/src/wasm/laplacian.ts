// Laplacian coordinates, declared in core/include/meshreel/laplacian.h.

import { FormatError } from "../errors.ts";
import type { Mesh } from "../mesh.ts";
import type { Core } from "./memory.ts";

/** Ascending anchors, far from each other, at least one for each component that has faces. */
export function farthestAnchors(core: Core, faces: Int32Array, vertices: number, count: number): Int32Array {
  return core.run((arena) => {
    const out = arena.room(4 * vertices);
    const sizes = [BigInt(faces.length / 3), BigInt(vertices), BigInt(count)] as const;
    const found = core.call("mr_farthest_anchors", arena.put(faces), ...sizes, out);
    if (found < 0) throw new FormatError("a face that names none of the vertices");
    return arena.i32(out, found);
  });
}

/** The mesh and the anchors that define the least squares. */
export interface LaplacianSystem {
  readonly base: Mesh;
  readonly anchors: Int32Array; // vertices, ascending
  readonly anchorWeight: number;
}

/** Weights V x `columns` that fit the deltas (V + anchors) x `columns` best in the least-squares sense (eq. 13). */
export function laplacianInverse(core: Core, { base, anchors, anchorWeight }: LaplacianSystem, deltas: Float64Array, columns: number): Float64Array {
  const vertices = base.vertices.length / 3;
  return core.run((arena) => {
    const out = arena.room(8 * vertices * columns);
    const system = [arena.mesh(base), arena.put(anchors), BigInt(anchors.length), anchorWeight] as const;
    const status = core.call("mr_laplacian_solve", ...system, arena.put(deltas), BigInt(columns), out);
    core.check(status, "displacements: the base's least squares have no solution: ");
    return arena.f64(out, vertices * columns);
  });
}

/** Rows of `width` numbers: the mean plus the sum of weights times vectors, in their order (eq. 9). */
export function kltInverse(core: Core, weights: Float64Array, rows: number, vectors: Float64Array, mean: Float64Array): Float64Array {
  const width = mean.length;
  return core.run((arena) => {
    const out = arena.room(8 * rows * width);
    const sizes = [BigInt(rows), BigInt(vectors.length / width)] as const;
    core.call("mr_klt_inverse", arena.put(weights), ...sizes, arena.put(vectors), arena.put(mean), BigInt(width), out);
    return arena.f64(out, rows * width);
  });
}
