// A group of frames as decoded: vertices and faces that all frames share, and the additions of single frames.

import { joined } from "../bytes.ts";
import { EMPTY, concatenate } from "../mesh.ts";
import type { Mesh } from "../mesh.ts";

export interface DecodedGroup {
  readonly frameCount: number; // T
  readonly vertexCount: number; // V
  readonly positions: Float64Array; // T x V x 3
  readonly faces: Int32Array;
  /** T x faces, 1 where a frame is shown without one; null where all frames have all. */
  readonly dropped: Uint8Array | null;
  /** The additional mesh of each frame; null where no frame has one. */
  readonly patches: readonly Mesh[] | null;
}

/** Red, green and blue of a group's vertices: of those that all frames share, frame after frame, then of those of single frames. */
export type GroupColors = Uint8Array;

/** Frames that share nothing. */
export function ofMeshes(meshes: readonly Mesh[]): DecodedGroup {
  return { frameCount: meshes.length, vertexCount: 0, positions: new Float64Array(0), faces: new Int32Array(0), dropped: null, patches: meshes };
}

/** Colours of the vertices of frame t, in the order of `frameOf`. */
export function colorsOf(group: DecodedGroup, colors: GroupColors, t: number): Uint8Array {
  const shared = 3 * group.vertexCount;
  const counts = (group.patches ?? []).map((mesh) => mesh.vertices.length);
  const start = counts.slice(0, t).reduce((sum, count) => sum + count, group.frameCount * shared);
  return joined([colors.subarray(t * shared, (t + 1) * shared), colors.subarray(start, start + (counts[t] ?? 0))]);
}

/** Frame t as one mesh: its vertices behind the shared ones, its faces behind those that it keeps. */
export function frameOf(group: DecodedGroup, t: number): Mesh {
  const size = 3 * group.vertexCount;
  const shared = { vertices: group.positions.subarray(t * size, (t + 1) * size), faces: keptFaces(group, t) };
  return concatenate([shared, group.patches?.[t] ?? EMPTY]);
}

/** Those of the shared faces that frame t is shown with. */
export function keptFaces(group: DecodedGroup, t: number): Int32Array {
  if (group.dropped === null) return group.faces;
  const count = group.faces.length / 3;
  const dropped = group.dropped.subarray(t * count, (t + 1) * count);
  const kept = new Int32Array(group.faces.length);
  let size = 0;
  for (let face = 0; face < count; face++) {
    if (dropped[face]) continue;
    kept.set(group.faces.subarray(3 * face, 3 * face + 3), size);
    size += 3;
  }
  return kept.subarray(0, size);
}
