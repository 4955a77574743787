// The view that shows all of a recording.

import { Vector3 } from "three";
import type { Box } from "@meshreel/player-core/types";

/** Direction from which it looks. */
export const FROM = new Vector3(0.25, 0.25, 1).normalize();

/**
 * How far above a box's middle a camera looks in the direction FROM, and from how far, so that the box's picture fills the view in one
 * direction and has its height in the middle; given the tangents of half the angles of view. The target stays on the box's axis, about which the camera turns.
 */
export function fitting({ size }: Box, wide: number, high: number): { lift: number; distance: number } {
  const right = new Vector3(0, 1, 0).cross(FROM).normalize();
  const up = FROM.clone().cross(right);
  let [above, below, aside] = [-Infinity, Infinity, 0]; // where planes through the corners, as steep as the view's borders, meet the axes
  for (let k = 0; k < 8; k++) {
    const corner = new Vector3(...size).multiply(new Vector3(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5, k & 4 ? 0.5 : -0.5));
    const [x, y, z] = [corner.dot(right), corner.dot(up), corner.dot(FROM)];
    above = Math.max(above, y + high * z);
    below = Math.min(below, y - high * z);
    aside = Math.max(aside, Math.abs(x) / wide + z);
  }
  const lift = (above + below) / 2 / up.y;
  return { lift, distance: Math.max((above - below) / (2 * high), aside) - lift * FROM.y };
}
