// Properties of the page's objects that a session changes, to be restored.

import type { Object3D, PerspectiveCamera, WebGLRenderer } from "three";
import { Vector2 } from "three";

/** Remembers; the function it gives puts everything back. */
export function keep(renderer: WebGLRenderer, camera: PerspectiveCamera, content: Object3D): () => void {
  const { enabled } = renderer.xr;
  const pixelRatio = renderer.getPixelRatio();
  const size = renderer.getSize(new Vector2());
  const restoreContent = keepTransform(content);
  const restoreCamera = keepTransform(camera);
  const { fov, zoom, near, far } = camera;
  return () => {
    renderer.xr.enabled = enabled;
    // three does this itself, but not where a session ended before it had begun.
    if (renderer.getPixelRatio() !== pixelRatio) renderer.setPixelRatio(pixelRatio);
    if (!renderer.getSize(new Vector2()).equals(size)) renderer.setSize(size.x, size.y, false);
    restoreContent();
    restoreCamera();
    Object.assign(camera, { fov, zoom, near, far });
    camera.updateProjectionMatrix();
  };
}

function keepTransform(object: Object3D): () => void {
  const [position, quaternion, scale, matrix] = [object.position.clone(), object.quaternion.clone(), object.scale.clone(), object.matrix.clone()];
  const { matrixAutoUpdate } = object;
  return () => {
    object.position.copy(position);
    object.quaternion.copy(quaternion);
    object.scale.copy(scale);
    object.matrix.copy(matrix);
    object.matrixAutoUpdate = matrixAutoUpdate;
    object.updateMatrixWorld(true);
  };
}
