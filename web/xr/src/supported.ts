// Detection of a headset. A separate module, so that a page can ask before it loads three.js.

const supports = async (mode: XRSessionMode): Promise<boolean> => navigator.xr?.isSessionSupported(mode).catch(() => false) ?? false;

/** True if a headset can show a recording. Never rejects. */
export const vrSupported = (): Promise<boolean> => supports("immersive-vr");

/** True if it can show a recording in the viewer's own room. Never rejects. */
export const arSupported = (): Promise<boolean> => supports("immersive-ar");
