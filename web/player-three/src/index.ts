// Draws recordings with three.js.

export { ReelScene } from "./scene.ts";
export { updateFar } from "./far.ts";
export { MODES } from "./modes.ts";
export type { Mode } from "./modes.ts";
export { Bench, formatReport } from "./bench.ts";
export type { BenchExtra, BenchReport, Spread } from "./bench.ts";
