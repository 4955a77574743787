// Hands that hold the recording. One moves it; two move it, turn it about the vertical and scale it.

import { Vector3 } from "three";
import { copyPose, makePose, SCALES } from "./pose.ts";
import type { Pose } from "./pose.ts";

const LEAST_SPAN = 0.02; // m between hands, below which their distance is noise (guess)
const LEAST_LEVEL_SPAN = 0.05; // m, seen from above, below which their direction is noise (guess)

/**
 * Follows the hands from where they took hold. Everything is measured from there, not from the last picture, so that nothing drifts
 * and a scale at its limit comes back as the hands do.
 */
export class Grab {
  readonly #taken = makePose();
  readonly #takenLeft = new Vector3();
  readonly #takenRight = new Vector3();
  readonly #takenMiddle = new Vector3();
  readonly #middle = new Vector3();
  #holdsLeft = false;
  #holdsRight = false;
  #turned = 0;

  /** Once a picture: where the hands that hold are, in the pose's own space, null for one that does not. Changes `pose`. */
  follow(pose: Pose, left: Vector3 | null, right: Vector3 | null): void {
    if ((left !== null) !== this.#holdsLeft || (right !== null) !== this.#holdsRight) this.#take(pose, left, right);
    if (left !== null && right !== null) this.#withBoth(pose, left, right);
    else if (left !== null) pose.position.copy(this.#taken.position).add(left).sub(this.#takenLeft);
    else if (right !== null) pose.position.copy(this.#taken.position).add(right).sub(this.#takenRight);
  }

  /** Restarts the grip of hands that hold: the pose was changed by something else. */
  release(): void {
    this.#holdsLeft = this.#holdsRight = false;
  }

  #take(pose: Pose, left: Vector3 | null, right: Vector3 | null): void {
    this.#holdsLeft = left !== null;
    this.#holdsRight = right !== null;
    copyPose(pose, this.#taken);
    if (left !== null) this.#takenLeft.copy(left);
    if (right !== null) this.#takenRight.copy(right);
    this.#takenMiddle.addVectors(this.#takenLeft, this.#takenRight).multiplyScalar(0.5);
    this.#turned = 0;
  }

  #withBoth(pose: Pose, left: Vector3, right: Vector3): void {
    const before = Math.max(this.#takenLeft.distanceTo(this.#takenRight), LEAST_SPAN);
    const now = Math.max(left.distanceTo(right), LEAST_SPAN);
    const { scale, turn, position } = this.#taken;
    pose.scale = Math.min(Math.max((scale * now) / before, SCALES.least), SCALES.most);
    this.#turned = this.#turnOf(left, right);
    pose.turn = turn + this.#turned;
    const factor = pose.scale / scale;
    const sin = Math.sin(this.#turned);
    const cos = Math.cos(this.#turned);
    const x = position.x - this.#takenMiddle.x;
    const y = position.y - this.#takenMiddle.y;
    const z = position.z - this.#takenMiddle.z;
    this.#middle.addVectors(left, right).multiplyScalar(0.5);
    // The point between the hands stays there.
    pose.position.set(cos * x + sin * z, y, cos * z - sin * x).multiplyScalar(factor).add(this.#middle);
  }

  /** Turn of the line from hand to hand, seen from above. */
  #turnOf(left: Vector3, right: Vector3): number {
    const x0 = this.#takenRight.x - this.#takenLeft.x;
    const z0 = this.#takenRight.z - this.#takenLeft.z;
    const x1 = right.x - left.x;
    const z1 = right.z - left.z;
    if (Math.hypot(x0, z0) < LEAST_LEVEL_SPAN || Math.hypot(x1, z1) < LEAST_LEVEL_SPAN) return this.#turned;
    return Math.atan2(z0 * x1 - x0 * z1, x0 * x1 + z0 * z1);
  }
}
