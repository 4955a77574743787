// Orientation of a recording in a scene.

import { Matrix4 } from "three";
import type { Box, Info } from "@meshreel/player-core/types";
import { stoodUp, turnOf } from "./upright.ts";
import type { Up } from "./upright.ts";

/** Turned by its edits, then upright, and the box around it. */
export function standing(info: Info, up: Up | null): { readonly turned: Matrix4; readonly box: Box } {
  const turn = turnOf(info.metadata, up);
  const [a, b, c, d, e, f, g, h, i] = info.rotation ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const edited = new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
  return { turned: new Matrix4().makeRotationX(turn).multiply(edited), box: stoodUp(info.box, turn) };
}
