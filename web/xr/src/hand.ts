// A controller: what is drawn of it and what it does.

import { BoxGeometry, CylinderGeometry, Mesh, MeshBasicMaterial, RingGeometry, Vector3 } from "three";
import type { BufferGeometry, Object3D, WebXRManager, WebXRSpaceEventMap } from "three";
import { Stick } from "./stick.ts";
import type { StickActions } from "./stick.ts";

export interface HandActions extends StickActions {
  /** `isHeld`: it was pressed for a while. */
  select(isHeld: boolean): void;
  /** Points along the -z of a space; null: no longer. Of a hand that is not the left one. */
  point(space: XRSpace | null): void;
  /** Goes to a point of the floor. */
  teleport(place: Vector3): void;
}

const RAY = { length: 0.8, radius: 0.0015 } as const; // m
const GRIP = { width: 0.03, length: 0.1 } as const; // m
const FREE = 0xd8dde6;
const HOLDING = 0x4da3ff;
const STILL = 0.03; // m: a bare hand that pinches and moves less plays or pauses (guess)
const HELD = 600; // ms that a press is held (guess)
const AIMS = 0.6; // of the way to the edge that a stick is pushed forward
const LONGEST = 8; // m, of a jump (guess)
const RING = [0.14, 0.18] as const; // m, radii of the mark on the floor
const STICK_BUTTON = 3; // of the mapping xr-standard
const STICK_X = 2;
const STICK_Y = 3; // -1 is forward

export class Hand {
  readonly #pointing: ReturnType<WebXRManager["getController"]>;
  readonly #grip: ReturnType<WebXRManager["getControllerGrip"]>;
  readonly #material = new MeshBasicMaterial({ color: FREE });
  readonly #ray = new Mesh(rayGeometry(), this.#material);
  readonly #body = new Mesh(new BoxGeometry(GRIP.width, GRIP.width, GRIP.length), this.#material);
  readonly #mark = new Mesh(new RingGeometry(...RING, 32).rotateX(-Math.PI / 2), this.#material); // where it would go
  readonly #from = new Vector3();
  readonly #along = new Vector3();
  readonly #actions: HandActions;
  readonly #stick: Stick;
  readonly #panel: Object3D;
  #source: XRInputSource | null = null;
  #squeezes = false;
  #pressed = 0; // ms
  #isSelected = false; // a press that the device cancels ends without a selection
  readonly #pinched = new Vector3(); // where a bare hand began to pinch, m

  /** To be made before the session starts, so that three gives it the controller. `room` is where the tracking space is drawn, `panel` what the left one wears. */
  constructor(xr: WebXRManager, index: number, room: Object3D, actions: HandActions, panel: Object3D) {
    this.#actions = actions;
    this.#panel = panel;
    this.#stick = new Stick(actions);
    this.#pointing = xr.getController(index);
    this.#grip = xr.getControllerGrip(index);
    this.#pointing.add(this.#ray);
    this.#grip.add(this.#body);
    this.#mark.visible = false;
    room.add(this.#pointing, this.#grip, this.#mark);
    this.#pointing.addEventListener("connected", this.#connect);
    this.#pointing.addEventListener("disconnected", this.#disconnect);
    this.#pointing.addEventListener("selectstart", this.#press);
    this.#pointing.addEventListener("select", this.#select);
    this.#pointing.addEventListener("selectend", this.#release);
    this.#pointing.addEventListener("squeezestart", this.#squeeze);
    this.#pointing.addEventListener("squeezeend", this.#letGo);
  }

  /** Point at which it holds the recording, in the room's space; null if it does not, or is not tracked. */
  get holds(): Vector3 | null {
    return this.#squeezes && this.#grip.visible ? this.#grip.position : null;
  }

  /** Once a picture, with milliseconds. */
  update(now: number): void {
    const gamepad = this.#source?.gamepad;
    if (gamepad) this.#aim(-(gamepad.axes[STICK_Y] ?? 0) > AIMS);
    if (gamepad) this.#stick.update(gamepad.axes[STICK_X] ?? gamepad.axes[0] ?? 0, gamepad.buttons[STICK_BUTTON]?.pressed ?? false, now);
  }

  dispose(): void {
    this.#pointing.removeEventListener("connected", this.#connect);
    this.#pointing.removeEventListener("disconnected", this.#disconnect);
    this.#pointing.removeEventListener("selectstart", this.#press);
    this.#pointing.removeEventListener("select", this.#select);
    this.#pointing.removeEventListener("selectend", this.#release);
    this.#pointing.removeEventListener("squeezestart", this.#squeeze);
    this.#pointing.removeEventListener("squeezeend", this.#letGo);
    for (const mesh of [this.#ray, this.#body, this.#mark]) {
      mesh.removeFromParent();
      mesh.geometry.dispose();
    }
    this.#material.dispose();
    this.#pointing.removeFromParent();
    this.#grip.removeFromParent();
  }

  /** Marks where it points at the floor while `aims`; goes there when it no longer does. */
  #aim(aims: boolean): void {
    if (!aims && this.#mark.visible) this.#actions.teleport(this.#mark.position);
    this.#mark.visible = false;
    if (!aims) return;
    const from = this.#from.setFromMatrixPosition(this.#pointing.matrixWorld);
    const along = this.#along.set(0, 0, -1).transformDirection(this.#pointing.matrixWorld);
    const way = -from.y / along.y;
    this.#mark.visible = way > 0 && way < LONGEST;
    this.#mark.position.copy(from).addScaledVector(along, way);
  }

  #connect = (event: WebXRSpaceEventMap["connected"]): void => {
    const { handedness, targetRayMode, targetRaySpace } = (this.#source = event.data);
    this.#ray.visible = targetRayMode === "tracked-pointer"; // a finger on a screen is seen already
    if (handedness === "left") this.#grip.add(this.#panel);
    else if (this.#ray.visible) this.#actions.point(targetRaySpace);
  };

  #disconnect = (): void => {
    if (this.#ray.visible && this.#source?.handedness !== "left") this.#actions.point(null);
    this.#source = null;
    this.#stick.reset();
    this.#mark.visible = false;
    this.#letGo();
  };

  /** A bare hand has no grip: it holds by a pinch. */
  #press = (): void => {
    this.#pressed = performance.now();
    if (!this.#isBare) return;
    this.#pinched.copy(this.#grip.position);
    this.#squeeze();
  };

  #select = (): void => {
    this.#isSelected = true;
  };

  #release = (): void => {
    if (this.#isBare) this.#letGo();
    const isSelected = this.#isSelected;
    this.#isSelected = false;
    const isStill = !this.#isBare || this.#grip.position.distanceTo(this.#pinched) < STILL;
    if (isSelected && isStill) this.#actions.select(performance.now() - this.#pressed > HELD);
  };

  get #isBare(): boolean {
    return this.#source?.hand != null;
  }

  #squeeze = (): void => {
    this.#squeezes = true;
    this.#material.color.setHex(HOLDING);
  };

  #letGo = (): void => {
    this.#squeezes = false;
    this.#material.color.setHex(FREE);
  };
}

function rayGeometry(): BufferGeometry {
  const ray = new CylinderGeometry(0, RAY.radius, RAY.length, 6, 1, true); // thinner away from the hand
  return ray.translate(0, RAY.length / 2, 0).rotateX(-Math.PI / 2);
}
