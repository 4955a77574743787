// The form LAYERS, declared in core/include/meshreel/layers.h.

import type { Mesh, Placement } from "../mesh.ts";
import type { Neighbours } from "./entropy.ts";
import type { Arena, Core } from "./memory.ts";

/** One midpoint subdivision: what it does to the connectivity. */
export interface Level {
  readonly coarse: Int32Array;
  readonly edges: Int32Array; // two vertices of each, sorted; edge e has vertex `vertices + e` in its middle
  readonly faces: Int32Array;
  readonly vertices: number; // of the coarser mesh
}

/** Connectivity of a level. It follows from the coarser level's faces alone, so groups that share them share it. */
export interface Connectivity {
  readonly level: Level;
  readonly siblings: Neighbours; // for each new vertex the earlier ones that share a face of the coarser level with it
}

export function subdivide(core: Core, faces: Int32Array, vertices: number): Level {
  const faceCount = faces.length / 3;
  return core.run((arena) => {
    const [edges, finer, found] = [arena.room(24 * faceCount), arena.room(48 * faceCount), arena.struct(["u32", 0])];
    core.check(core.call("mr_subdivide", arena.put(faces), faceCount, vertices, edges, finer, found));
    return { coarse: faces, edges: arena.i32(edges, 2 * arena.u32(found)), faces: arena.i32(finer, 12 * faceCount), vertices };
  });
}

export function connectivity(core: Core, faces: Int32Array, vertices: number): Connectivity {
  const level = subdivide(core, faces, vertices);
  const [faceCount, edgeCount] = [faces.length / 3, level.edges.length / 2];
  return core.run((arena) => {
    const [starts, near] = [arena.room(8 * (edgeCount + 1)), arena.room(12 * faceCount)];
    core.check(core.call("mr_siblings", arena.put(level.faces), faceCount, vertices, edgeCount, starts, near));
    const found = arena.i64(starts, edgeCount + 1);
    return { level, siblings: { starts: found, near: arena.i32(near, Number(found[edgeCount])) } };
  });
}

/** Rows of the base mesh's vertices out of a LayersGroup record: for each vertex the x of all frames, then their y, then their z. */
export function decodeMotion(core: Core, record: Uint8Array, base: Mesh, frames: number): Float64Array {
  const size = frames * base.vertices.length;
  return core.run((arena) => {
    const rows = arena.room(8 * size);
    core.check(core.call("mr_decode_motion", arena.record(record), arena.mesh(base), frames, rows));
    return arena.f64(rows, size);
  });
}

/** What a LayersLevel record refines. */
export interface Coarser {
  readonly frames: number;
  readonly near: Connectivity;
  readonly rows: Float64Array; // of the coarser level's vertices
  readonly previous: Float64Array | null; // scalars of the level in the last frame of the group before
}

/** Rows of the finer level's vertices, and the last frame's scalars. FormatError where the record is damaged. */
export function decodeLevel(core: Core, record: Uint8Array, coarser: Coarser): [Float64Array, Float64Array] {
  const { rows } = coarser;
  const { edgeCount, size } = sizesOf(coarser);
  return core.run((arena) => {
    const [finer, last] = [arena.room(8 * size), arena.room(8 * edgeCount)];
    new Float64Array(core.buffer, finer, rows.length).set(rows);
    core.check(core.call("mr_decode_level", arena.record(record), levelOf(arena, coarser), finer, last));
    return [arena.f64(finer, size), arena.f64(last, edgeCount)];
  });
}

/** Positions of a last level, frames x vertices x 3, and the last frame's scalars. */
export function decodeLastLevel(core: Core, record: Uint8Array, coarser: Coarser, place: Placement): [Float64Array, Float64Array] {
  const { edgeCount, size } = sizesOf(coarser);
  return core.run((arena) => {
    const [positions, last] = [arena.room(8 * size), arena.room(8 * edgeCount)];
    const arrays = [arena.record(record), levelOf(arena, coarser), arena.put(coarser.rows), last] as const;
    core.check(core.call("mr_decode_last_level", ...arrays, framesOf(arena, positions, place)));
    return [arena.f64(positions, size), arena.f64(last, edgeCount)];
  });
}

/** Rows as frames. FormatError where they are not finite. */
export function framesOfRows(core: Core, rows: Float64Array, vertices: number, place: Placement): Float64Array {
  return core.run((arena) => {
    const positions = arena.room(8 * rows.length);
    const frames = vertices > 0 ? rows.length / vertices / 3 : 0;
    core.check(core.call("mr_frames_of_rows", arena.put(rows), frames, vertices, framesOf(arena, positions, place)));
    return arena.f64(positions, rows.length);
  });
}

/** How many edges the coarser level has, and numbers the finer one. */
function sizesOf({ frames, near }: Coarser): { edgeCount: number; size: number } {
  const { edges, vertices } = near.level;
  const edgeCount = edges.length / 2;
  return { edgeCount, size: 3 * frames * (vertices + edgeCount) };
}

/** A struct mr_frames. */
function framesOf(arena: Arena, positions: number, place: Placement): number {
  const [x, y, z] = place.origin;
  const placement = arena.struct(["f64", place.scale], ["f64", x], ["f64", y], ["f64", z]);
  return arena.struct(["u32", positions], ["u32", placement], ["u32", 0]);
}

/** A struct mr_level. */
function levelOf(arena: Arena, coarser: Coarser): number {
  const { level, siblings } = coarser.near;
  const { edgeCount } = sizesOf(coarser);
  const [faces, edges] = [arena.put(level.coarse), arena.put(level.edges)];
  const [starts, near] = [arena.put(siblings.starts), arena.put(siblings.near)];
  const previous = coarser.previous?.length === edgeCount ? arena.put(coarser.previous) : 0;
  return arena.struct(
    ["u32", coarser.frames],
    ["u32", level.vertices],
    ["u32", faces],
    ["u32", level.coarse.length / 3],
    ["u32", edges],
    ["u32", edgeCount],
    ["u32", starts],
    ["u32", near],
    ["u32", previous],
  );
}
