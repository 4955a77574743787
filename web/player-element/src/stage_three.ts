import type { Stage } from "./stage.ts";
export class ThreeStage extends EventTarget { constructor(_c: HTMLCanvasElement) { super(); } }
export interface ThreeStage extends Stage {}
