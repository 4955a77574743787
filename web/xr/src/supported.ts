// Whether there is a headset. By itself, so that a page asks before it has three.js.

/** Whether there is one that can show a recording. Never rejects. */
export async function vrSupported(): Promise<boolean> {
  return navigator.xr?.isSessionSupported("immersive-vr").catch(() => false) ?? false;
}
