// A recording in a headset: WebXR's immersive-vr, drawn by three.js.

export { vrSupported, VrSession } from "./session.ts";
export type { VrActions, VrOptions } from "./session.ts";
