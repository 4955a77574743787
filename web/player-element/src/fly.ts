// Flying through a room: a drag looks around, keys, wheel and two fingers move.

import { Euler, MathUtils, Vector3 } from "three";
import type { PerspectiveCamera } from "three";

const WAYS: Readonly<Record<string, readonly [number, number, number]>> = { // right, up, back
  w: [0, 0, -1], s: [0, 0, 1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0],
};
const SPEED = 0.3; // of the recording's size a second (guess)
const FASTER = 3; // with Shift
const STEP = 0.06; // of its size, of a notch of the wheel
const STEEPEST = 1.5; // radians from level
const LONGEST = 0.1; // s between two pictures that movement follows

export class Fly {
  /** The recording's size, m. */
  size = 1;
  readonly #eye: PerspectiveCamera;
  readonly #moved: () => void;
  readonly #held = new Set<string>();
  readonly #pointers = new Map<number, PointerEvent>();
  #faster = false;
  #before = 0; // ms, of the last picture; 0 while it stands
  #stop: AbortController | null = null;

  constructor(eye: PerspectiveCamera, moved: () => void) {
    this.#eye = eye;
    this.#moved = moved;
  }

  get on(): boolean {
    return this.#stop !== null;
  }

  begin(canvas: HTMLCanvasElement): void {
    const { signal } = (this.#stop = new AbortController());
    const keys = canvas.parentElement ?? canvas; // this element has the focus
    keys.addEventListener("keydown", (event) => this.#key(event, true), { signal });
    keys.addEventListener("keyup", (event) => this.#key(event, false), { signal });
    keys.addEventListener("blur", () => this.#held.clear(), { signal });
    canvas.addEventListener("pointerdown", (event) => {
      this.#pointers.set(event.pointerId, event);
      canvas.setPointerCapture(event.pointerId);
    }, { signal });
    canvas.addEventListener("pointermove", (event) => this.#drag(event, canvas.clientHeight), { signal });
    for (const type of ["pointerup", "pointercancel"] as const) canvas.addEventListener(type, (event) => this.#pointers.delete(event.pointerId), { signal });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#go(0, 0, STEP * Math.sign(event.deltaY));
    }, { signal, passive: false });
  }

  end(): void {
    this.#stop?.abort();
    this.#stop = null;
    this.#held.clear();
    this.#pointers.clear();
  }

  /** Moves by the keys that are held; true where the next picture will differ. */
  update(now: number): boolean {
    const seconds = this.#before > 0 ? Math.min(LONGEST, (now - this.#before) / 1000) : 0;
    this.#before = this.#held.size > 0 ? now : 0;
    const way = new Vector3();
    for (const key of this.#held) way.add(new Vector3(...WAYS[key]!));
    const step = SPEED * seconds * (this.#faster ? FASTER : 1);
    if (step > 0) this.#go(way.x * step, way.y * step, way.z * step);
    return this.#held.size > 0;
  }

  #key(event: KeyboardEvent, down: boolean): void {
    this.#faster = event.shiftKey;
    const key = event.key.toLowerCase();
    if (!(key in WAYS) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.stopPropagation(); // S would show the statistics
    if (down) this.#held.add(key);
    else this.#held.delete(key);
    this.#moved();
  }

  #drag(event: PointerEvent, height: number): void {
    const before = this.#pointers.get(event.pointerId);
    if (before === undefined) return;
    this.#pointers.set(event.pointerId, event);
    const [x, y] = [(event.clientX - before.clientX) / height, (event.clientY - before.clientY) / height];
    const other = [...this.#pointers.values()].find(({ pointerId }) => pointerId !== event.pointerId);
    if (other === undefined) return this.#turn(x, y);
    const reach = (at: PointerEvent): number => Math.hypot(at.clientX - other.clientX, at.clientY - other.clientY) / height;
    this.#go(-x / 2, y / 2, reach(before) - reach(event));
  }

  #turn(x: number, y: number): void {
    const turn = new Euler().setFromQuaternion(this.#eye.quaternion, "YXZ");
    const field = MathUtils.degToRad(this.#eye.fov);
    turn.y += x * field; // the view follows the finger
    turn.x = MathUtils.clamp(turn.x + y * field, -STEEPEST, STEEPEST);
    this.#eye.quaternion.setFromEuler(turn);
    this.#moved();
  }

  /** By shares of the recording's size: to the right, straight up, back. */
  #go(right: number, up: number, back: number): void {
    const way = new Vector3(right, 0, back).applyQuaternion(this.#eye.quaternion);
    this.#eye.position.addScaledVector(way.setY(way.y + up), this.size);
    this.#moved();
  }
}
