// Ranges of a packed value that each frame draws.

import type { Packed, PackedGroup } from "@meshreel/player-core/types";

/** Its frame within the group: 0 up to T - 1, also for a frame beside it. */
export function localFrame(group: PackedGroup, frame: number): number {
  return Math.min(Math.max(frame - group.firstFrame, 0), group.frameCount - 1);
}

/** Number of triangles that a frame shows. */
export function triangleCount(packed: Packed, frame: number): number {
  const always = packed.faces.length;
  if (packed.kind === "static") return always / 3;
  const t = localFrame(packed, frame);
  return (always + packed.extraStarts[t + 1] - packed.extraStarts[t]) / 3;
}

/** Largest number of the value's vertices, padding included. */
export function vertexRoom(packed: Packed): number {
  if (packed.kind === "static") return packed.vertexCount;
  return packed.textureWidth * packed.textureHeight - (packed.frameCount - 1) * packed.vertexCount;
}
