// What of a packed value is drawn in which frame.

import type { Packed, PackedGroup } from "@meshreel/player-core/types";

/** Its frame within the group: 0 up to T - 1, also for a frame beside it. */
export function localFrame(group: PackedGroup, frame: number): number {
  return Math.min(Math.max(frame - group.firstFrame, 0), group.frameCount - 1);
}

/** How many triangles a frame shows. */
export function triangleCount(packed: Packed, frame: number): number {
  const always = packed.faces.length;
  if (packed.kind === "static") return always / 3;
  const t = localFrame(packed, frame);
  return (always + packed.extraStarts[t + 1] - packed.extraStarts[t]) / 3;
}

/** How many numbers vertices of the value can have, padding included. */
export function vertexRoom(packed: Packed): number {
  if (packed.kind === "static") return packed.vertexCount;
  return packed.textureWidth * packed.textureHeight - (packed.frameCount - 1) * packed.vertexCount;
}
