// Laplacian coordinates, as core/include/meshreel/laplacian.h has them.

import { FormatError } from "../errors.ts";
import type { Mesh } from "../mesh.ts";
import type { Core } from "./memory.ts";

const SINGULAR = 2;

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

/** What the least squares are set up from. */
export interface LaplacianSystem {
  readonly base: Mesh;
  readonly anchors: Int32Array; // vertices, ascending
  readonly anchorWeight: number;
}

/** Weights V x `columns` that fit the deltas (V + anchors) x `columns` best in the least-squares sense (eq. 13). */
export function laplacianInverse(core: Core, { base, anchors, anchorWeight }: LaplacianSystem, deltas: Float64Array, columns: number): Float64Array {
  const vertices = base.vertices.length / 3;
  return core.run((arena) => {
    const made = arena.struct(["u32", 0]);
    const mesh = [arena.put(base.vertices), BigInt(vertices), arena.put(base.faces), BigInt(base.faces.length / 3)] as const;
    check(core.call("mr_laplacian_create", ...mesh, arena.put(anchors), BigInt(anchors.length), anchorWeight, made));
    const system = arena.u32(made);
    try {
      const out = arena.room(8 * vertices * columns);
      check(core.call("mr_laplacian_inverse", system, arena.put(deltas), BigInt(columns), out));
      return arena.f64(out, vertices * columns);
    } finally {
      core.call("mr_laplacian_destroy", system);
    }
  });
}

function check(status: number): void {
  if (status === 0) return;
  const why = status === SINGULAR ? "a connected component has no anchor" : "an index is out of range or a coordinate is not finite";
  throw new FormatError(`displacements: the base's least squares have no solution: ${why}`);
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
