// Views that show all of a recording.

import { Vector3 } from "three";
import type { Box } from "@meshreel/player-core/types";

/** Direction from which a view of the whole looks. */
export const FROM = new Vector3(0.25, 0.25, 1).normalize();

const SPARE = 1.05; // times the size of what a file's view shows: what a bar may take of the encoder's MARGIN of 1.1 (guess)

/**
 * How far above a box's middle a camera looks in the direction FROM, and from how far, so that the box's picture fills the view in one
 * direction and has its height in the middle; given the tangents of half the angles of view. The target stays on the box's axis, about which the camera turns.
 */
export function fitting(box: Box, wide: number, high: number): { lift: number; distance: number } {
  const middle = new Vector3(...box.minimum).addScaledVector(new Vector3(...box.size), 0.5);
  const corners = cornersOf(box, middle, FROM);
  // Where planes through the corners, as steep as the view's borders, meet the axes.
  const above = Math.max(...corners.map(([, y, z]) => y + high * z));
  const below = Math.min(...corners.map(([, y, z]) => y - high * z));
  const aside = Math.max(...corners.map(([x, , z]) => Math.abs(x) / wide + z));
  const lift = (above + below) / 2 / Math.hypot(FROM.x, FROM.z);
  return { lift, distance: Math.max((above - below) / (2 * high), aside) - lift * FROM.y };
}

/** Shape of a picture. */
export interface Lens {
  readonly tangent: number; // of half the angle of view of its height
  readonly aspect: number; // width by height
  readonly free: number; // share of its height that no bar covers
}

/**
 * Times the distance from its target at which a file's view is shown, which is made for a square picture. One with less room, because it is higher
 * than wide or a bar covers much of it, shows as much from farther away. A wider one comes nearer if all of the box, which the square one shows,
 * stays in it: otherwise its sides would be empty. `away` is the way from the target as the file has it, or with `isShown` as this picture does.
 */
export function timesAway(box: Box, target: Vector3, away: Vector3, { tangent, aspect, free }: Lens, isShown = false): number {
  const high = Math.min(1, SPARE * free);
  const usual = 1 / Math.min(high, aspect);
  if (aspect <= high) return usual;
  const corners = cornersOf(box, target, away.clone().normalize());
  const least = (right: number, up: number): number => Math.max(...corners.map(([x, y, z]) => Math.max(Math.abs(x) / right, Math.abs(y) / up) + z));
  const square = least(tangent, tangent);
  const wide = least(tangent * aspect, tangent * high);
  if (square <= 0 || wide <= 0) return usual; // all is behind the target
  const times = Math.min(usual, wide / square);
  return away.length() < square * (isShown ? times : 1) ? usual : times;
}

/** Corners of a box, seen in a direction: to the right of a place, above it, and nearer than it. */
function cornersOf({ minimum, size }: Box, place: Vector3, from: Vector3): [number, number, number][] {
  const right = new Vector3(from.z, 0, -from.x).normalize();
  const up = from.clone().cross(right);
  return Array.from({ length: 8 }, (_, k) => {
    const corner = new Vector3(...minimum.map((low, axis) => low + ((k >> axis) & 1) * size[axis])).sub(place);
    return [corner.dot(right), corner.dot(up), corner.dot(from)];
  });
}
