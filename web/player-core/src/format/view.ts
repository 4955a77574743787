// The first view of a file, from its metadata. Beside format/view.py.

import { LARGEST } from "./layout.gen.ts";
import type { FirstView, Point } from "../types.ts";

const APART = 1e-6; // least distance of position and target, normalised

/** The first view, scaled and turned as the file's box is; null where the file has none: any tag could have this name before. */
export function viewOf(metadata: Readonly<Record<string, unknown>>, scale: number, rotation: readonly number[]): FirstView | null {
  const item = metadata.view;
  if (typeof item !== "object" || item === null) return null;
  const { position, target, fov } = item as Record<string, unknown>;
  if (!isPoint(position) || !isPoint(target) || typeof fov !== "number" || !(fov > 0 && fov < 180)) return null;
  if (Math.hypot(...position.map((value, k) => value - target[k])) < APART) return null;
  const placed = (point: Point): Point => [0, 1, 2].map((row) => scale * point.reduce((sum, value, k) => sum + rotation[3 * row + k] * value, 0)) as unknown as Point;
  return { position: placed(position), target: placed(target), fov };
}

function isPoint(value: unknown): value is Point {
  return Array.isArray(value) && value.length === 3 && value.every((part) => typeof part === "number" && Math.abs(part) <= LARGEST);
}
