// The form LAYERS, as core/include/meshreel/layers.h has it.

import { FormatError } from "../errors.ts";
import type { Mesh, Placement } from "../mesh.ts";
import type { Neighbours } from "./entropy.ts";
import type { Arena, Core } from "./memory.ts";

/** A causal graph: each value is predicted by the weighted sum of those near it, which come before it. */
export interface Graph extends Neighbours {
  readonly weights: Float64Array;
}

/** An order of a mesh's vertices, coarse to fine, and the graph of their places in it. */
export interface Hierarchy {
  readonly order: Int32Array;
  readonly graph: Graph;
}

/** A field as coded: symbols column after column, of `columns` orthonormal vectors of `width` numbers. */
export interface FieldValues {
  readonly symbols: Int32Array;
  readonly graph: Graph;
  readonly step: number;
  readonly columns: number;
  readonly vectors: Float64Array;
  readonly means: Float64Array; // `width` numbers
  readonly before: Float64Array | null; // one number a value, added to its row
}

/** One midpoint subdivision: what it does to the connectivity. */
export interface Level {
  readonly coarse: Int32Array;
  readonly edges: Int32Array; // two vertices of each, sorted; edge e has vertex `vertices + e` in its middle
  readonly faces: Int32Array;
  readonly vertices: number; // of the coarser mesh
}

export function hierarchy(core: Core, base: Mesh): Hierarchy {
  const vertices = base.vertices.length / 3;
  return core.run((arena) => {
    const made = arena.struct(["u32", 0]);
    check(core.call("mr_hierarchy_create", arena.put(base.vertices), vertices, arena.put(base.faces), base.faces.length / 3, made));
    const owner = arena.u32(made);
    try {
      const order = arena.i32(core.call("mr_hierarchy_order", owner), vertices);
      const graph = arena.struct(["u32", 0], ["u32", 0], ["u32", 0], ["u32", 0]);
      core.call("mr_hierarchy_graph", graph, owner); // a struct is given back through its place
      const starts = arena.i64(arena.u32(graph + 4), vertices + 1);
      const links = Number(starts[vertices]);
      return { order, graph: { starts, near: arena.i32(arena.u32(graph + 8), links), weights: arena.f64(arena.u32(graph + 12), links) } };
    } finally {
      core.call("mr_hierarchy_destroy", owner);
    }
  });
}

/** `count` orthonormal vectors of `width` numbers. */
export function orthonormalInverse(core: Core, symbols: Int32Array, count: number, width: number): Float64Array {
  return core.run((arena) => {
    const out = arena.room(8 * count * width);
    if (core.call("mr_orthonormal_inverse", arena.put(symbols), count, width, out) !== 0) throw new FormatError("a basis vector without a direction");
    return arena.f64(out, count * width);
  });
}

/** A row of numbers for each value. */
export function fieldInverse(core: Core, field: FieldValues): Float64Array {
  const count = (field.graph.starts.length - 1) * field.means.length;
  return core.run((arena) => {
    const rows = arena.room(8 * count);
    check(core.call("mr_field_inverse", fieldOf(arena, field), rows));
    return arena.f64(rows, count);
  });
}

/** Where vertices are in all frames: rows of all frames' x, then their y, then their z. FormatError where not finite. */
export function placeRows(core: Core, moved: Float64Array, order: Int32Array, base: Float64Array): Float64Array {
  const vertices = order.length;
  const frames = vertices > 0 ? moved.length / vertices / 3 : 0;
  return core.run((arena) => {
    const rows = arena.room(8 * moved.length);
    const finite = core.call("mr_place_rows", arena.put(moved), arena.put(order), arena.put(base), vertices, frames, rows);
    if (!finite) throw new FormatError("a motion that is not finite");
    return arena.f64(rows, moved.length);
  });
}

export function subdivide(core: Core, faces: Int32Array, vertices: number): Level {
  const faceCount = faces.length / 3;
  return core.run((arena) => {
    const [edges, finer, found] = [arena.room(24 * faceCount), arena.room(48 * faceCount), arena.struct(["u32", 0])];
    check(core.call("mr_subdivide", arena.put(faces), faceCount, vertices, edges, finer, found));
    return { coarse: faces, edges: arena.i32(edges, 2 * arena.u32(found)), faces: arena.i32(finer, 12 * faceCount), vertices };
  });
}

/** For each new vertex of a level those before it that share a face of the coarser level with it. */
export function siblings(core: Core, level: Level): Neighbours {
  const [faceCount, edgeCount] = [level.coarse.length / 3, level.edges.length / 2];
  return core.run((arena) => {
    const [starts, near] = [arena.room(8 * (edgeCount + 1)), arena.room(12 * faceCount)];
    check(core.call("mr_siblings", arena.put(level.faces), faceCount, level.vertices, edgeCount, starts, near));
    const found = arena.i64(starts, edgeCount + 1);
    return { starts: found, near: arena.i32(near, Number(found[edgeCount])) };
  });
}

/** Weights that predict each by weight / 64 of the mean of those near it. */
export function siblingWeights(core: Core, near: Neighbours, weight: number): Graph {
  return core.run((arena) => {
    const weights = arena.room(8 * near.near.length);
    core.call("mr_sibling_weights", arena.put(near.starts), near.starts.length - 1, weight, weights);
    return { ...near, weights: arena.f64(weights, near.near.length) };
  });
}

/** What makes a level's new vertices: how it is subdivided, and how far along its normals they lie. */
export interface Refinement {
  readonly level: Level;
  readonly field: FieldValues;
  readonly curvature: number; // 64ths of the bend of its edges by which midpoints are lifted
}

/** Rows of the finer level's vertices from the coarser one's, and the last frame's scalars. */
export function refineField(core: Core, rows: Float64Array, { level, field, curvature }: Refinement): [Float64Array, Float64Array] {
  const frames = field.means.length;
  const edgeCount = level.edges.length / 2;
  const size = 3 * frames * (level.vertices + edgeCount);
  return core.run((arena) => {
    const [finer, last] = [arena.room(8 * size), arena.room(8 * edgeCount)];
    new Float64Array(core.buffer, finer, rows.length).set(rows);
    check(core.call("mr_refine_field", levelOf(arena, level, frames, curvature), fieldOf(arena, field), finer, last));
    return [arena.f64(finer, size), arena.f64(last, edgeCount)];
  });
}

/** How the last level's vertices are shown. */
export interface Refined {
  readonly positions: Float64Array; // frames x vertices x 3
  readonly last: Float64Array;
}

/** The same of a last level, as frames. FormatError where they are not finite. */
export function refineFieldFrames(core: Core, rows: Float64Array, { level, field, curvature }: Refinement, place: Placement): Refined {
  const frames = field.means.length;
  const edgeCount = level.edges.length / 2;
  const size = 3 * frames * (level.vertices + edgeCount);
  return core.run((arena) => {
    const [positions, last] = [arena.room(8 * size), arena.room(8 * edgeCount)];
    const out = framesOf(arena, positions, place);
    const arrays = [levelOf(arena, level, frames, curvature), fieldOf(arena, field), arena.put(rows), last] as const;
    check(core.call("mr_refine_field_frames", ...arrays, out));
    checkFinite(arena, out);
    return { positions: arena.f64(positions, size), last: arena.f64(last, edgeCount) };
  });
}

/** Frames of rows. FormatError where they are not finite. */
export function framesOfRows(core: Core, rows: Float64Array, vertices: number, place: Placement): Float64Array {
  return core.run((arena) => {
    const positions = arena.room(8 * rows.length);
    const out = framesOf(arena, positions, place);
    check(core.call("mr_frames_of_rows", arena.put(rows), vertices > 0 ? rows.length / vertices / 3 : 0, vertices, out));
    checkFinite(arena, out);
    return arena.f64(positions, rows.length);
  });
}

const FINITE = 8; // offset of mr_frames.finite

function framesOf(arena: Arena, positions: number, place: Placement): number {
  const [x, y, z] = place.origin;
  const placement = arena.struct(["f64", place.scale], ["f64", x], ["f64", y], ["f64", z]);
  return arena.struct(["u32", positions], ["u32", placement], ["i32", 0]);
}

function checkFinite(arena: Arena, frames: number): void {
  if (arena.u32(frames + FINITE) === 0) throw new FormatError("vertices that are not finite");
}

function levelOf(arena: Arena, level: Level, frames: number, curvature: number): number {
  const [faces, edges] = [arena.put(level.coarse), arena.put(level.edges)];
  return arena.struct(
    ["u32", frames],
    ["u32", level.vertices],
    ["u32", faces],
    ["u32", level.coarse.length / 3],
    ["u32", edges],
    ["u32", level.edges.length / 2],
    ["i32", curvature],
  );
}

/** A struct mr_field: its graph, its basis, then symbols, step and what values are counted from. */
function fieldOf(arena: Arena, field: FieldValues): number {
  const { graph } = field;
  const [starts, near, weights] = [arena.put(graph.starts), arena.put(graph.near), arena.put(graph.weights)];
  const [vectors, means, symbols] = [arena.put(field.vectors), arena.put(field.means), arena.put(field.symbols)];
  const before = field.before === null ? 0 : arena.put(field.before);
  return arena.struct(
    ["u32", graph.starts.length - 1],
    ["u32", starts],
    ["u32", near],
    ["u32", weights],
    ["u32", field.columns],
    ["u32", field.means.length],
    ["u32", vectors],
    ["u32", means],
    ["u32", symbols],
    ["f64", field.step],
    ["u32", before],
  );
}

function check(status: number): void {
  if (status !== 0) throw new FormatError("an index is out of range, or a graph is not causal");
}
