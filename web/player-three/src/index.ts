// Draws recordings with three.js.

export { Ground } from "./ground.ts";
export { ReelScene } from "./scene.ts";
export { updateFar } from "./far.ts";
export { Sorter } from "./sorter.ts";
export type { OrderWorker } from "./sorter.ts";
export { MODES, shownMode } from "./modes.ts";
export type { Mode } from "./modes.ts";
export { lying, standing } from "./standing.ts";
export type { Up } from "./upright.ts";
export { Bench, formatReport } from "./bench.ts";
export type { BenchExtra, BenchReport, Spread } from "./bench.ts";
