// Appearances of surfaces.

import type { Info } from "@meshreel/player-core/types";

/**
 * The splats on its bodies, and what has none as "color"; the recording's own colours, unlit; these with some relief, or lit clay where there are none; rgb = (n + 1) / 2; as "shaded", with the triangles' edges; an
 * unlit colour of each track. What has no colours of its own is shaded in place of "color".
 */
export const MODES = ["splats", "color", "shaded", "normal", "wireframe", "tracks"] as const;
export type Mode = (typeof MODES)[number];

/** Appearance of a recording. */
export type Looks = Pick<Info, "hasColors" | "hasSplats">;

/** Modes that a recording can be shown in. */
export function modesOf(has: Looks | null): readonly Mode[] {
  return MODES.filter((mode) => (mode !== "splats" || has?.hasSplats) && (mode !== "color" || has?.hasColors));
}

/** The mode that is wanted, or what comes nearest of those that the recording has. */
export function shownMode(wanted: Mode, has: Looks | null): Mode {
  return [wanted, "color" as const].find((mode) => modesOf(has).includes(mode)) ?? "shaded";
}
