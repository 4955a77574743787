// Orientation of a recording in a scene.

import { Matrix4, Vector3 } from "three";
import type { Box, FirstView, Info } from "@meshreel/player-core/types";
import { stoodUp, turnOf } from "./upright.ts";
import type { Up } from "./upright.ts";

export interface Standing {
  readonly turned: Matrix4;
  readonly box: Box;
  /** The file's; null where it has none, and where another axis than its own points up. */
  readonly view: FirstView | null;
}

/** Turned by its edits, then upright, with the box around it and its first view. */
export function standing(info: Info, up: Up | null): Standing {
  const turn = turnOf(info.metadata, up);
  const upright = new Matrix4().makeRotationX(turn);
  const [a, b, c, d, e, f, g, h, i] = info.rotation ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const edited = new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
  const placed = (place: readonly number[]): FirstView["position"] => new Vector3(...place).applyMatrix4(upright).toArray();
  const { view = null } = info;
  const holds = view !== null && turn === turnOf(info.metadata);
  return { turned: upright.clone().multiply(edited), box: stoodUp(info.box, turn), view: holds ? { ...view, position: placed(view.position), target: placed(view.target) } : null };
}

/** The reverse for a place in the scene: where it is in the coordinates of the file's frames, m. */
export function lying(place: Vector3, info: Info, up: Up | null): Vector3 {
  return place.clone().applyMatrix4(new Matrix4().makeRotationX(-turnOf(info.metadata, up))).add(new Vector3(...info.origin));
}
