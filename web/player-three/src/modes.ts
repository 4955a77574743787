// How surfaces may look.

/** Lit clay; rgb = (n + 1) / 2; lit clay with its triangles' edges; an unlit colour of each track. */
export const MODES = ["shaded", "normal", "wireframe", "colour"] as const;
export type Mode = (typeof MODES)[number];
