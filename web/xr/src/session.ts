// A session in a headset, from the click to the moment at which the page is as it was.

import type { Object3D, PerspectiveCamera, Vector3, WebGLRenderer } from "three";
import type { Box, FirstView } from "@meshreel/player-core/types";
import type { VrActions } from "./actions.ts";
import { Anchor } from "./anchor.ts";
import { Floor } from "./floor.ts";
import { Grab } from "./grab.ts";
import { Hand } from "./hand.ts";
import { keep } from "./keep.ts";
import { Panel } from "./panel.ts";
import { applyPose, makePose, place, setViewer, standBefore } from "./pose.ts";
import type { Viewer } from "./pose.ts";
import { Reticle } from "./reticle.ts";

export interface VrOptions {
  readonly renderer: WebGLRenderer;
  readonly camera: PerspectiveCamera; // without a parent; the one that `frame` draws with
  /** Stands in a scene that has no transformation. The session sets its own one; what is below it stays. */
  readonly content: Object3D;
  readonly box: Box; // around the content, y up
  readonly view?: FirstView | null; // from which it is seen at first
  readonly actions: VrActions;
  readonly passthrough?: boolean; // in the viewer's own room, seen by the headset's cameras
  /** Draws a picture, with a clock's milliseconds. Must not set the renderer's size or the camera. */
  frame(now: number): void;
  /** The session is over, whoever ended it, and everything is as before. */
  onend(): void;
}

const RATE = 90; // Hz: at most, of those that the headset offers
const NEAR = 0.05; // m
const FAR = 1000; // m
const SEEK = 1; // s, each time that a held thumbstick repeats
const OPTIONAL = ["bounded-floor", "layers", "hand-tracking"];

/** The recording in a headset, at true scale in front of the viewer. */
export class VrSession {
  readonly #options: VrOptions;
  readonly #session: XRSession;
  readonly #restore: () => void;
  readonly #hands: readonly Hand[];
  readonly #floor: Floor | null;
  readonly #reticle: Reticle | null; // in the viewer's own room
  readonly #anchor = new Anchor();
  #isChosen = false; // the place that the reticle is at
  readonly #panel = new Panel();
  readonly #pose = makePose();
  readonly #grab = new Grab();
  readonly #viewer: Viewer = { x: 0, z: 0, turn: 0 };
  readonly #over: Promise<void>;
  #resolve!: () => void;
  #foveation: number | undefined;
  #placed = false;
  #entered = false;
  #closed = false;

  /**
   * Must be called in answer to a user's gesture. The page's animation loop stands still until the end, that of three by itself, one
   * of `requestAnimationFrame` by its owner. Rejects where there is no headset, or the viewer declines; all is then as before.
   */
  static async enter(options: VrOptions): Promise<VrSession> {
    const { xr } = navigator;
    if (xr === undefined) throw new Error("this browser has no WebXR here; it needs https, or localhost");
    if (options.content.parent === null) throw new Error("the content is in no scene; add it to one first");
    const optionalFeatures = options.passthrough ? [...OPTIONAL, "hit-test", "anchors"] : OPTIONAL;
    const session = await xr.requestSession(options.passthrough ? "immersive-ar" : "immersive-vr", { requiredFeatures: ["local-floor"], optionalFeatures });
    const entered = new VrSession(options, session);
    await entered.#begin();
    return entered;
  }

  private constructor(options: VrOptions, session: XRSession) {
    const { renderer, camera, content, actions } = options;
    this.#options = options;
    this.#session = session;
    this.#over = new Promise((resolve) => (this.#resolve = resolve));
    this.#restore = keep(renderer, camera, content);
    const handActions = {
      select: (isHeld: boolean) => this.#select(isHeld),
      point: (space: XRSpace | null) => void this.#reticle?.aim(space),
      tap: (side: number) => actions.step(side),
      hold: (side: number) => actions.seekBy(SEEK * side),
      click: () => {
        this.#place();
        if (this.#reticle) this.#reticle.seeks = true;
      },
      teleport: (place: Vector3) => this.#go(place),
    };
    const room = content.parent!;
    this.#floor = options.passthrough ? null : new Floor();
    if (this.#floor) room.add(this.#floor);
    this.#reticle = options.passthrough ? new Reticle(session) : null;
    if (this.#reticle) room.add(this.#reticle);
    this.#hands = [0, 1].map((index) => new Hand(renderer.xr, index, room, handActions, this.#panel));
  }

  /** Pictures a second of the headset; 0 where it does not report it. */
  get rate(): number {
    return this.#session.frameRate ?? 0;
  }

  /** Resolves when everything is as before. */
  async end(): Promise<void> {
    this.#session.end().catch(() => undefined); // it may have ended already
    await this.#over;
  }

  async #begin(): Promise<void> {
    const { renderer, camera } = this.#options;
    const { xr } = renderer;
    xr.addEventListener("sessionend", this.#close); // after three has put back what is its own
    try {
      xr.enabled = true;
      xr.setReferenceSpaceType("local-floor");
      camera.near = NEAR;
      camera.far = FAR;
      xr.setAnimationLoop(this.#frame); // of the headset alone: the page's own stays with the renderer
      await xr.setSession(this.#session);
      if (this.#closed) throw new Error("the headset ended the session");
      this.#foveation = xr.getFoveation();
      xr.setFoveation(1);
      this.#askForRate();
      this.#entered = true;
    } catch (error) {
      await this.#session.end().catch(() => undefined); // it may have ended already
      this.#close();
      throw error;
    }
  }

  #askForRate(): void {
    const session = this.#session;
    const offered = [...(session.supportedFrameRates ?? [])].filter((rate) => rate <= RATE);
    if (offered.length > 0) session.updateTargetFrameRate(Math.max(...offered)).catch(() => undefined); // its own rate does too
  }

  /** Nothing is allocated here, but four times a second for the panel, and where the device knows the viewer's own room. */
  #frame = (now: number): void => {
    const left = this.#hands[0];
    const right = this.#hands[1];
    if (!this.#placed) this.#place();
    left.update(now);
    right.update(now);
    this.#panel.update(now, this.#options.actions.time);
    this.#settle();
    this.#grab.follow(this.#pose, left.holds, right.holds);
    applyPose(this.#pose, this.#options.content);
    this.#options.frame(now);
  };

  /** In the viewer's own room: stands the recording where they chose, and keeps it there. */
  #settle(): void {
    const { xr } = this.#options.renderer;
    const [frame, space, reticle] = [xr.getFrame(), xr.getReferenceSpace(), this.#reticle];
    if (space === null || reticle === null) return;
    this.#anchor.follow(this.#pose, frame, space);
    const hit = reticle.find(frame, space);
    if (this.#isChosen && hit !== null) {
      this.#look();
      standBefore(this.#viewer, reticle.position);
      this.#stand(reticle.position.y);
      reticle.seeks = reticle.visible = false;
      void this.#anchor.drop(hit);
    }
    this.#isChosen = false;
  }

  /** Chooses the place that the reticle shows; else plays or pauses. Held, it looks for another place. */
  #select(isHeld: boolean): void {
    if (this.#reticle?.visible) this.#isChosen = true;
    else if (this.#reticle?.finds && isHeld) this.#reticle.seeks = true;
    else this.#options.actions.toggle();
  }

  /** Moves the recording so that what is at a point of the floor comes under the viewer. */
  #go({ x, z }: Vector3): void {
    this.#look();
    this.#pose.position.x += this.#viewer.x - x;
    this.#pose.position.z += this.#viewer.z - z;
    this.#grab.release();
  }

  /** In front of where the viewer is now. Until the headset knows, of where the room has its zero. */
  #place(): void {
    this.#placed = this.#look();
    this.#stand(0);
  }

  /** Before the viewer, or around them, at a height. */
  #stand(height: number): void {
    const { box, view, passthrough } = this.#options;
    place(box, this.#viewer, this.#pose, passthrough, view);
    this.#pose.position.y += height;
    this.#grab.release();
  }

  /** Takes in where the viewer is; false where the headset does not know yet. */
  #look(): boolean {
    const { xr } = this.#options.renderer;
    const space = xr.getReferenceSpace();
    const head = space === null ? undefined : xr.getFrame().getViewerPose(space)?.transform;
    if (head !== undefined) setViewer(this.#viewer, head.position, head.orientation);
    return head !== undefined;
  }

  #close = (): void => {
    if (this.#closed) return;
    this.#closed = true;
    const { renderer, onend } = this.#options;
    renderer.xr.removeEventListener("sessionend", this.#close);
    renderer.xr.setAnimationLoop(null);
    if (this.#foveation !== undefined) renderer.xr.setFoveation(this.#foveation);
    for (const hand of this.#hands) hand.dispose();
    this.#floor?.dispose();
    this.#reticle?.dispose();
    this.#panel.dispose();
    this.#restore();
    this.#resolve();
    if (this.#entered) onend();
  };
}
