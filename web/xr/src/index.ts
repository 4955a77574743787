// A recording in a headset: WebXR's immersive-vr and immersive-ar, drawn by three.js.

export { VrSession } from "./session.ts";
export { arSupported, vrSupported } from "./supported.ts";
export type { VrActions } from "./actions.ts";
export type { VrOptions } from "./session.ts";
