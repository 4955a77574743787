// A recording in a headset: WebXR's immersive-vr, drawn by three.js.

export { VrSession } from "./session.ts";
export { vrSupported } from "./supported.ts";
export type { VrActions, VrOptions } from "./session.ts";
