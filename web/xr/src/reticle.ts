// A ring on the real surface that a hand, or else the viewer, points at. The device's hit tests find it.

import { Mesh, MeshBasicMaterial, RingGeometry } from "three";

const RING = [0.14, 0.18] as const; // m, radii
const COLOR = 0x4da3ff;
const LEVEL = 0.8; // least part of a surface's normal that points up, where a recording can stand (guess)

/** Shown while a place is looked for; without hit tests it finds none. */
export class Reticle extends Mesh<RingGeometry, MeshBasicMaterial> {
  /** True while a place is looked for. */
  seeks = true;
  readonly #session: XRSession;
  #source: XRHitTestSource | undefined;
  #asked = 0;

  constructor(session: XRSession) {
    super(new RingGeometry(...RING, 32).rotateX(-Math.PI / 2), new MeshBasicMaterial({ color: COLOR }));
    this.#session = session;
    this.visible = false;
    void this.aim(null);
  }

  /** True if the device has hit tests. */
  get finds(): boolean {
    return this.#source !== undefined;
  }

  /** Points along the -z of a space from now on; with null it is where the viewer looks. */
  async aim(space: XRSpace | null): Promise<void> {
    const session = this.#session;
    const asked = ++this.#asked;
    try {
      const source = await session.requestHitTestSource?.({ space: space ?? (await session.requestReferenceSpace("viewer")) });
      if (asked !== this.#asked) return source?.cancel();
      this.#source?.cancel();
      this.#source = source;
    } catch {
      // the device has none, or the session is over
    }
  }

  /** Once a picture: lies on the first level surface, and gives what found that; null where there is none. */
  find(frame: XRFrame, space: XRSpace): XRHitTestResult | null {
    this.visible = false;
    if (!this.seeks || this.#source === undefined) return null;
    for (const hit of frame.getHitTestResults(this.#source)) {
      const matrix = hit.getPose(space)?.transform.matrix;
      if (matrix === undefined || matrix[5] < LEVEL) continue;
      this.visible = true;
      this.position.set(matrix[12], matrix[13], matrix[14]);
      return hit;
    }
    return null;
  }

  override dispose(): void {
    super.dispose();
    this.removeFromParent();
    this.geometry.dispose();
    this.material.dispose();
  }
}
