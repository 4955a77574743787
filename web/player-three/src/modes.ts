// How surfaces may look.

/**
 * The splats on its bodies, and what has none as "color"; the recording's own colours, unlit; these lit, or clay where there are none; rgb = (n + 1) / 2; as "shaded", with the triangles' edges; an
 * unlit colour of each track. What has no colours of its own is shaded in place of "color".
 */
export const MODES = ["splats", "color", "shaded", "normal", "wireframe", "tracks"] as const;
export type Mode = (typeof MODES)[number];
