// A stage that draws with three.js: the recording, a camera that orbits it, and a headset.

import type { Box, FirstView, Info, Packed, Shown } from "@meshreel/player-core/types";
import { Ground, lying, ReelScene, Sorter, standing, updateFar } from "@meshreel/player-three";
import type { Mode, OrderWorker } from "@meshreel/player-three";
import { VrSession } from "@meshreel/xr";
import type { VrActions } from "@meshreel/xr";
import { Box3, Color, Group, PerspectiveCamera, Scene, Spherical, Vector3, WebGLRenderer } from "three";
import type { Matrix4 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { readCamera } from "./attributes.ts";
import { fitting, FROM, timesAway } from "./fitting.ts";
import { Fly } from "./fly.ts";
import type { PictureStats, Stage } from "./stage.ts";
import type { Up } from "@meshreel/player-three/upright";

const FOV = 45; // degrees, of the picture's height, where the recording does not say
const DIGITS = 4; // of a view's numbers, relative to its distance
const MARGIN = 1.05; // around what just fits
const STEEPEST = 0.01; // radians from straight above or below
const CLOSEST = 1e-3; // of the recording's size: how near the camera comes
const FARTHEST = 20; // of its size: how far the camera goes
const NEAR = 0.002; // of the camera's distance: what it sees. A background may reach far beyond the recording's box.
const FAR = 50;

export class ThreeStage extends EventTarget implements Stage {
  readonly canvas: HTMLCanvasElement;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #content = new Group(); // moved by a headset
  readonly #eye = new PerspectiveCamera(FOV, 1, 0.01, 1000);
  readonly #orbit: OrbitControls;
  readonly #stop = new AbortController();
  readonly #sorter: Sorter;
  readonly #floor = new Ground();
  #shaded: Shown | null = null; // the mesh of the shadow on it
  ground = true;
  exposure = 1;
  #reel: ReelScene;
  #box: Box | null = null; // of the recording, as it stands
  #info: Info | null = null; // of the recording
  #first: FirstView | null = null; // the recording's own first view, as it stands
  #up: Up | null = null;
  #mode: Mode = "shaded";
  #background = "";
  #free = 1; // of the picture's height: what the bar leaves
  readonly #fly = new Fly(this.#eye, () => this.#flown());
  #drawnAt = 0; // ms
  isFit = true; // it shows what it begins with, and does so again when the picture's size changes
  #session: VrSession | null = null;
  readonly #place = new Vector3(); // of the eye, in the recording's space
  readonly far = new Set<number>();

  /** `openOrder`: makes a worker that orders splats. */
  constructor(canvas: HTMLCanvasElement, openOrder: () => OrderWorker) {
    super();
    this.canvas = canvas;
    this.#sorter = new Sorter(openOrder);
    this.#sorter.onorder = () => this.dispatchEvent(new Event("change"));
    this.#reel = new ReelScene(this.#sorter);
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "high-performance" });
    this.#scene.add(this.#content);
    this.#content.add(this.#reel, this.#floor);
    const { signal } = this.#stop;
    canvas.addEventListener("webglcontextlost", () => this.dispatchEvent(new Event("lost")), { signal });
    canvas.addEventListener("webglcontextrestored", () => {
      this.#shaded = null;
      this.dispatchEvent(new Event("restored"));
    }, { signal });
    this.#orbit = new OrbitControls(this.#eye, canvas);
    this.#orbit.enableDamping = glides();
    this.#orbit.addEventListener("start", () => void (this.isFit = false));
    this.#orbit.addEventListener("change", () => this.#moved());
  }

  get stats(): PictureStats {
    const { visible, triangles, gpuBytes, splats } = this.#reel;
    const count = visible ? splats.reduce((sum, some) => sum + some, 0) : 0;
    return { triangles: visible ? triangles : 0, gpuBytes, splats: count, sortMs: this.#sorter.lastMs, headsetRate: this.#session?.rate ?? 0 };
  }

  get presenting(): boolean {
    return this.#renderer.xr.isPresenting;
  }

  get mode(): Mode {
    return this.#mode;
  }

  set mode(mode: Mode) {
    this.#mode = this.#reel.mode = mode;
  }

  get background(): string {
    return this.#background;
  }

  set background(colour: string) {
    this.#background = colour;
    const isOpaque = !/^rgba|\//.test(colour); // as a computed style is written; what lies behind the canvas has the colour, too
    this.#scene.background = isOpaque ? new Color(colour) : null; // not a clear colour: that would be lost with the context
  }

  get camera(): string {
    return [...this.#eye.position.toArray(), ...this.#orbit.target.toArray()].map((value) => value.toFixed(3)).join(",");
  }

  set camera(text: string) {
    const values = readCamera(text);
    if (values) this.#look(new Vector3(...values.slice(0, 3)), new Vector3(...values.slice(3)));
    else this.#begin();
  }

  get viewOfFile(): string {
    if (!this.#info) return "";
    const { target } = this.#orbit;
    const away = this.#eye.position.clone().sub(target);
    const eye = target.clone().addScaledVector(away, 1 / this.#back(target, away, true));
    const digits = Math.min(12, Math.max(0, DIGITS - Math.floor(Math.log10(eye.distanceTo(target)))));
    const places = [eye, target].flatMap((place) => lying(place, this.#info!, this.#up).toArray());
    return [...places.map((value) => value.toFixed(digits)), this.#eye.fov].join(",");
  }

  get autoRotate(): boolean {
    return this.#orbit.autoRotate;
  }

  set autoRotate(on: boolean) {
    this.#orbit.autoRotate = on && glides();
    if (this.#orbit.autoRotate) this.dispatchEvent(new Event("change"));
    else this.#rest();
  }

  get fly(): boolean {
    return this.#fly.on;
  }

  set fly(on: boolean) {
    if (on === this.#fly.on) return;
    this.#orbit.enabled = !on;
    if (on) this.#fly.begin(this.canvas);
    else this.#fly.end();
  }

  get up(): Up | null {
    return this.#up;
  }

  set up(axis: Up | null) {
    if (axis === this.#up) return;
    this.#up = axis;
    this.exitVr(); // it stands on the recording's floor
    if (this.#info) this.#stand(this.#info);
  }

  begin(info: Info): void {
    this.exitVr(); // a session's place is that of one recording
    this.#reel.removeFromParent();
    this.#reel.dispose();
    this.#reel = new ReelScene(this.#sorter);
    this.#reel.mode = this.#mode;
    this.#content.add(this.#reel);
    this.#stand(info);
  }

  prepare(packed: Packed): void {
    this.#reel.prepare(packed, this.#renderer);
  }

  release(packed: Packed): void {
    this.#reel.release(packed);
  }

  draw(shown: Shown | null): boolean {
    this.#reel.exposure = this.exposure;
    if (shown) this.#reel.show(shown);
    if (this.presenting) this.far.clear(); // it comes near
    else if (shown) updateFar(this.far, shown, this.#reel.worldToLocal(this.#place.copy(this.#eye.position)), this.canvas.height / (2 * this.#tangent));
    this.#reel.splats.forEach((count, track) => void (count > 0 && this.far.add(track)));
    this.#reel.visible = shown !== null;
    this.#shade(shown);
    const now = performance.now();
    const moves = !this.presenting && (this.fly ? this.#fly.update(now) : this.#orbit.update(Math.min(0.1, (now - this.#drawnAt) / 1000)));
    this.#drawnAt = now;
    this.#renderer.render(this.#scene, this.#eye);
    return moves;
  }

  /** The shadow is drawn anew where what is shown is another. A room has a floor of its own, and in its colours are shadows already; splats cast none. */
  #shade(shown: Shown | null): void {
    const isLit = this.#mode === "color" || this.#mode === "shaded" || this.#mode === "splats";
    const room = shown?.background ?? null;
    const isColored = room !== null && (room.colors !== null || shown!.backgroundImage !== null);
    const casts = this.ground && isLit && !isColored && !this.#reel.splats.some((count) => count > 0);
    this.#floor.visible = casts && shown !== null && room === null;
    if (!casts || shown === null) {
      this.#shaded = null;
      this.#reel.darken(null);
    } else if (shown !== this.#shaded) {
      this.#shaded = shown;
      const box = room && boxOf(shown, this.#reel.matrix); // of who is in the room
      this.#floor.lie(box ?? this.#box!);
      this.#floor.shade(this.#reel, this.#renderer, room !== null);
    }
  }

  resize(width: number, height: number, pixelRatio: number, covered: number): void {
    if (this.presenting) return; // the headset has its own size
    this.#renderer.setPixelRatio(pixelRatio);
    this.#renderer.setSize(width, height, false);
    this.#eye.aspect = width / height;
    this.#free = Math.max(0.2, 1 - covered / height);
    this.#eye.setViewOffset(width, height, 0, ((1 - this.#free) * height) / 2, width, height);
    if (this.isFit) this.#begin();
  }

  fit(): void {
    if (this.isFit && this.#first) this.#whole();
    else this.#begin();
  }

  orbit(right: number, up: number, closer: number): void {
    const { target, minDistance, maxDistance } = this.#orbit;
    const place = new Spherical().setFromVector3(this.#eye.position.clone().sub(target));
    place.theta += right;
    place.phi = Math.min(Math.PI - STEEPEST, Math.max(STEEPEST, place.phi - up));
    place.radius = Math.min(maxDistance, Math.max(minDistance, place.radius / closer));
    this.#look(new Vector3().setFromSpherical(place).add(target), target);
  }

  picture(shown: Shown | null): Promise<Blob> {
    this.draw(shown);
    return new Promise((done, fail) => this.canvas.toBlob((blob) => (blob ? done(blob) : fail(new Error("no picture"))), "image/png"));
  }

  async enterVr(frame: (now: number) => void, actions: VrActions, passthrough: boolean): Promise<void> {
    const box = this.#box;
    const view = this.#first;
    if (this.#session !== null || !box) return;
    const onend = (): void => {
      this.#session = null;
      this.dispatchEvent(new Event("vrend"));
    };
    const [renderer, camera, content] = [this.#renderer, this.#eye, this.#content];
    this.#session = await VrSession.enter({ renderer, camera, content, box, view, actions, frame, onend, passthrough });
    this.dispatchEvent(new Event("vrstart"));
  }

  exitVr(): void {
    void this.#session?.end();
  }

  dispose(): void {
    this.exitVr();
    this.#fly.end();
    this.#stop.abort();
    this.#orbit.dispose();
    this.#reel.dispose();
    this.#floor.dispose();
    this.#sorter.dispose();
    this.#renderer.dispose();
    this.#renderer.forceContextLoss();
  }

  /** Around the whole recording. */
  #ball({ minimum, size }: Box): { middle: Vector3; radius: number } {
    const middle = new Vector3(...minimum).addScaledVector(new Vector3(...size), 0.5);
    return { middle, radius: Math.hypot(...size) / 2 || 1 };
  }

  /** Of half of the angle of view. */
  get #tangent(): number {
    return Math.tan((this.#eye.fov * Math.PI) / 360);
  }

  /** Times the distance of a file's view. */
  #back(target: Vector3, away: Vector3, isShown: boolean): number {
    return timesAway(this.#box!, target, away, { tangent: this.#tangent, aspect: this.#eye.aspect, free: this.#free }, isShown);
  }

  /** The recording's first view, or else all of it. */
  #begin(): void {
    if (this.#first) {
      const target = new Vector3(...this.#first.target);
      const away = new Vector3(...this.#first.position).sub(target);
      this.#look(target.clone().addScaledVector(away, this.#back(target, away, false)), target);
    } else this.#whole();
    this.isFit = true;
  }

  #whole(): void {
    if (!this.#box) return;
    const { middle } = this.#ball(this.#box);
    const { lift, distance } = fitting(this.#box, (this.#tangent * this.#eye.aspect) / MARGIN, (this.#tangent * this.#free) / MARGIN);
    middle.y += lift;
    this.#look(middle.clone().addScaledVector(FROM, distance || 1), middle);
  }

  #look(eye: Vector3, target: Vector3): void {
    this.isFit = false;
    this.#eye.position.copy(eye);
    this.#orbit.target.copy(target);
    this.#rest(); // a view that is asked for is there at once
    this.#moved();
  }

  /** Ends a glide. */
  #rest(): void {
    this.#orbit.enableDamping = false;
    this.#orbit.update();
    this.#orbit.enableDamping = glides();
  }

  /** Keep the target in front of the camera, to orbit around it when flying ends. */
  #flown(): void {
    this.isFit = false;
    this.#orbit.target.set(0, 0, -this.#fly.size / 4).applyQuaternion(this.#eye.quaternion).add(this.#eye.position);
    this.#moved();
  }

  /** A recording on its floor, all of it in view. */
  #stand(info: Info): void {
    this.#info = info;
    const { turned, box, view } = standing(info, this.#up);
    this.#box = box;
    this.#first = view;
    this.#eye.fov = view?.fov ?? FOV;
    this.#reel.stand(turned, box.minimum[1], box.size[1]);
    this.#floor.lie(box);
    this.#fly.size = 2 * this.#ball(box).radius;
    this.#shaded = null;
    this.#begin();
  }

  /** Near and far follow the camera, so that depth has its precision where the recording is. */
  #moved(): void {
    if (this.#box && !this.presenting) {
      const { middle, radius } = this.#ball(this.#box);
      const distance = this.#eye.position.distanceTo(middle);
      this.#orbit.minDistance = CLOSEST * radius;
      this.#orbit.maxDistance = FARTHEST * radius;
      this.#eye.near = NEAR * Math.max(distance, radius);
      this.#eye.far = FAR * Math.max(distance, radius);
      this.#eye.updateProjectionMatrix();
    }
    this.dispatchEvent(new Event("change"));
    this.dispatchEvent(new Event("camerachange"));
  }
}

/** Around all that moves, as it stands; null where nothing does. */
function boxOf({ groups }: Shown, standing: Matrix4): Box | null {
  const around = new Box3();
  for (const group of groups) {
    if (group === null) continue;
    const low = new Vector3(...group.box.minimum);
    around.union(new Box3(low, low.clone().add(new Vector3(...group.box.size))));
  }
  if (around.isEmpty()) return null;
  around.applyMatrix4(standing);
  return { minimum: around.min.toArray(), size: around.getSize(new Vector3()).toArray() };
}

/** True if the camera comes to rest softly. */
function glides(): boolean {
  return !matchMedia("(prefers-reduced-motion: reduce)").matches;
}
