// Draws recordings with three.js.

export { ReelScene } from "./scene.ts";
export { MODES } from "./materials.ts";
export type { Mode } from "./materials.ts";
