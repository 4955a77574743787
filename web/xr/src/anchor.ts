// A place of the real world that the device keeps track of: where it comes to know the place better, what stands there moves along.

import { Vector3 } from "three";
import { UP } from "./pose.ts";
import type { Pose } from "./pose.ts";

export class Anchor {
  #anchor: XRAnchor | undefined;
  #hit: XRHitTestResult | null = null;
  readonly #before = new Vector3(); // m, where it was
  #turn: number | null = null; // rad about the vertical; null before it was anywhere

  /** Takes the place that a hit test found, within the picture that found it. A device without anchors keeps track of none. */
  async drop(hit: XRHitTestResult): Promise<void> {
    this.#anchor?.delete();
    this.#anchor = undefined;
    this.#hit = hit;
    const anchor = await hit.createAnchor?.().catch(() => undefined);
    if (this.#hit !== hit) return anchor?.delete();
    this.#anchor = anchor;
    this.#turn = null;
  }

  /** Once a picture: moves a pose as the place has moved since the last one. */
  follow(pose: Pose, frame: XRFrame, space: XRSpace): void {
    const now = this.#anchor && frame.getPose(this.#anchor.anchorSpace, space)?.transform;
    if (!now) return;
    const turn = 2 * Math.atan2(now.orientation.y, now.orientation.w);
    if (this.#turn !== null) {
      pose.position.sub(this.#before).applyAxisAngle(UP, turn - this.#turn).add(now.position);
      pose.turn += turn - this.#turn;
    }
    this.#before.copy(now.position);
    this.#turn = turn;
  }
}
