// Whether there is a headset. By itself, so that a page asks before it has three.js.

const supports = async (mode: XRSessionMode): Promise<boolean> => navigator.xr?.isSessionSupported(mode).catch(() => false) ?? false;

/** Whether there is one that can show a recording. Never rejects. */
export const vrSupported = (): Promise<boolean> => supports("immersive-vr");

/** Whether it can show one in the viewer's own room. Never rejects. */
export const arSupported = (): Promise<boolean> => supports("immersive-ar");
