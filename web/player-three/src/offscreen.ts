// Drawing into a target of one's own, whatever the renderer is at.

import type { WebGLRenderer, WebGLRenderTarget } from "three";

/** Has `draw` draw into a target; the renderer is then as it was. A headset's session would draw for its eyes: it is left out meanwhile. */
export function drawOffscreen(renderer: WebGLRenderer, target: WebGLRenderTarget, draw: () => void): void {
  const before = renderer.getRenderTarget();
  const { enabled } = renderer.xr;
  renderer.xr.enabled = false;
  renderer.setRenderTarget(target);
  draw();
  renderer.setRenderTarget(before);
  renderer.xr.enabled = enabled;
}
