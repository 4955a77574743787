// The page of session.browser.test.ts: a canvas of 640 x 320, a recording, and a headset that is simulated.

import { metaQuest3, XRDevice } from "iwer";
import { Group, Mesh, MeshBasicMaterial, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import type { Box } from "@meshreel/player-core/types";
import { ReelScene } from "@meshreel/player-three";
import { makeFloor, makeGroup } from "../../../player-three/test/analytic.ts";
import { vrSupported, VrSession } from "../../src/index.ts";
import { Reticle } from "../../src/reticle.ts";

const [WIDTH, HEIGHT] = [640, 320];
const BOX: Box = { minimum: [-1, -0.5, -1], size: [2, 1.3, 2] }; // the sphere's way and the floor below it

const device = new XRDevice(metaQuest3, { stereoEnabled: true });

const renderer = new WebGLRenderer({ antialias: false });
renderer.setPixelRatio(2);
renderer.setSize(WIDTH / 2, HEIGHT / 2);
renderer.setClearColor(0x203040);
document.body.append(renderer.domElement);
const camera = new PerspectiveCamera(50, 2, 0.1, 20);
camera.position.set(0.5, 1, 3);
camera.lookAt(0, 0, 0);
const root = new Scene();
const content = new Group();
content.position.set(0.1, 0.2, 0.3);
const reel = new ReelScene();
content.add(reel);
root.add(content);

const [group, floor] = [makeGroup({ isColored: true, center: (t) => [-0.3 + 0.2 * t, 0, 0] }).packed, makeFloor(4).packed];
for (const packed of [group, floor]) reel.prepare(packed, renderer);

type Surroundings = InstanceType<Parameters<XRDevice["installSEM"]>[0]>;

/** A real room that the device knows: a floor, not quite where its tracking takes it to be, before a wall. */
class Room implements Surroundings {
  static readonly floor = 0.3; // m
  readonly version = "";
  readonly environmentCanvas = document.createElement("canvas");
  readonly trackedPlanes: Surroundings["trackedPlanes"] = new Set();
  readonly trackedMeshes: Surroundings["trackedMeshes"] = new Set();
  planesVisible = false;
  boundingBoxesVisible = false;
  meshesVisible = false;
  render(): void {}
  loadEnvironment(): void {}
  loadDefaultEnvironment(): void {}
  deleteAll(): void {}
  computeDepthBuffer(): null {
    return null;
  }
  /** Where a ray along its -z meets the floor; else the wall, whose y points at the viewer. */
  computeHitTestResults(ray: ArrayLike<number>): number[][] {
    const way = (Room.floor - ray[13]) / -ray[9];
    const [x, z] = [ray[12] - way * ray[8], ray[14] - way * ray[10]];
    if (way > 0 && z > -3) return [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, Room.floor, z, 1]];
    return [[1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, -3, 1]];
  }
}

let vr: VrSession | null = null;
let pictures = 0;
let pageFrames = 0;
let told: string[] = [];
let correction = { x: 0, turn: 0 }; // of anchors
let time = 0; // s
let wanted: ((picture: string) => void) | null = null;
renderer.setAnimationLoop(() => pageFrames++);

function frame(): void {
  pictures++;
  reel.show({ frame: 2, blend: 0, frames: [2], groups: [group], background: floor, images: [null], backgroundImage: null });
  renderer.render(root, camera);
  wanted?.(renderer.domElement.toDataURL()); // only now: the next frame clears it
  wanted = null;
}

/** What one eye sees of the recording: shares of its pixels, and where on average, 0 left to 1 right. */
interface Seen {
  readonly sphere: number;
  readonly floor: number;
  readonly middle: number;
  readonly sky: readonly [number, number]; // shares of the upper and the lower half that show nothing but the background
}

/** The sphere is yellow, the floor grey, what is behind them blue and dark. */
function seenBy(eye: 0 | 1, picture: ImageData): Seen {
  const { data, width, height } = picture;
  const half = width / 2;
  let [sphere, floor, sum] = [0, 0, 0];
  const sky: [number, number] = [0, 0];
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < half; x++) {
      const at = 4 * (y * width + eye * half + x);
      const [red, blue] = [data[at], data[at + 2]];
      if (Math.abs(red - 0x20) < 3 && Math.abs(blue - 0x40) < 3) sky[y < height / 2 ? 0 : 1] += 2 / (half * height);
      if (red - blue > 30) {
        sphere++;
        sum += x / half;
      } else if (red > 100 && red < 190 && blue - red < 30) floor++;
    }
  }
  return { sphere: sphere / (half * height), floor: floor / (half * height), middle: sum / Math.max(sphere, 1), sky };
}

async function pixelsOf(picture: string): Promise<ImageData> {
  const bitmap = await createImageBitmap(await (await fetch(picture)).blob());
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
  if (context === null) throw new Error("no 2D canvas");
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height);
}

const api = {
  supported: vrSupported,
  install(): void {
    device.installRuntime({ forceInstall: true });
    const { prototype } = XRFrame;
    const own = prototype.getPose;
    prototype.getPose = function (space, base) {
      const pose = own.call(this, space, base);
      if (!pose || ![...(this.trackedAnchors ?? [])].some(({ anchorSpace }) => anchorSpace === space)) return pose;
      const { x, y, z } = pose.transform.position;
      const { turn } = correction;
      return { transform: new XRRigidTransform({ x: x + correction.x, y, z }, { x: 0, y: Math.sin(turn / 2), z: 0, w: Math.cos(turn / 2) }) } as XRPose;
    };
  },
  /** The session comes, its space does not. */
  async enterWithoutSpace(): Promise<void> {
    const { prototype } = XRSession;
    const own = prototype.requestReferenceSpace;
    prototype.requestReferenceSpace = () => Promise.reject(new Error("no floor"));
    await api.enter().finally(() => (prototype.requestReferenceSpace = own));
  },
  async enter(passthrough = false): Promise<void> {
    told = [];
    vr = await VrSession.enter({
      renderer, camera, content, box: BOX, frame, passthrough,
      actions: {
        toggle: () => told.push("toggle"),
        step: (frames) => told.push(`step ${frames}`),
        seekBy: (seconds) => told.push(`seek ${seconds}`),
        time: () => [time, 2],
      },
      onend: () => told.push(`end ${renderer.xr.isPresenting}`),
    });
  },
  /** From now on the device knows the room around it. */
  knowRoom: () => device.installSEM(Room),
  /** Where the ring on the floor is; null where there is none. */
  reticle(): number[] | null {
    const ring = root.children.find((object) => object instanceof Reticle);
    return ring?.visible ? ring.position.toArray() : null;
  },
  /** The device finds that all places it keeps track of are elsewhere: so far to the right, and turned about the vertical. */
  correct(x: number, turn: number): void {
    correction = { x, turn };
  },
  end: async (): Promise<void> => vr?.end(),
  /** As when the viewer presses the headset's own button. */
  endFromDevice: async (): Promise<void> => device.activeSession?.end(),
  /** Lets the headset ask for so many pictures. */
  async frames(count: number): Promise<void> {
    const until = pictures + count;
    while (pictures < until) await new Promise((done) => setTimeout(done, 5));
  },
  /** What both eyes see, and the picture. */
  async eyes(): Promise<{ left: Seen; right: Seen; picture: string }> {
    const picture = await new Promise<string>((done) => (wanted = done));
    const pixels = await pixelsOf(picture);
    return { left: seenBy(0, pixels), right: seenBy(1, pixels), picture };
  },
  pose(hand: "left" | "right", x: number, y: number, z: number): void {
    device.controllers[hand]?.position.set(x, y, z);
  },
  button(hand: "left" | "right", id: string, value: number): void {
    device.controllers[hand]?.updateButtonValue(id, value);
  },
  stick(hand: "left" | "right", x: number, y = 0): void {
    device.controllers[hand]?.updateAxes("thumbstick", x, y);
  },
  /** Bare hands instead of controllers, or these again. */
  bare(isBare: boolean): void {
    device.primaryInputMode = isBare ? "hand" : "controller";
  },
  hand(x: number, y: number, z: number, pinch: number): void {
    device.hands.right?.position.set(x, y, z);
    device.hands.right?.updatePinchValue(pinch);
  },
  /** Degrees that a hand points below the horizon. */
  tilt(hand: "left" | "right", degrees: number): void {
    const half = (-degrees * Math.PI) / 360;
    device.controllers[hand]?.quaternion.set(Math.sin(half), 0, 0, Math.cos(half));
  },
  head(x: number, y: number, z: number): void {
    device.position.set(x, y, z);
  },
  /** What a session must leave as it was. */
  state() {
    const { position, quaternion, fov, zoom, near, far, projectionMatrix } = camera;
    return {
      content: content.matrixWorld.toArray(), camera: [...position.toArray(), ...quaternion.toArray(), fov, zoom, near, far],
      projection: projectionMatrix.toArray(), pixelRatio: renderer.getPixelRatio(), width: renderer.domElement.width,
      height: renderer.domElement.height, enabled: renderer.xr.enabled, presenting: renderer.xr.isPresenting,
      children: root.children.length, target: renderer.getRenderTarget() === null,
    };
  },
  drawOnPage(): void {
    frame();
  },
  memory: () => ({ ...renderer.info.memory }),
  content: () => ({ position: content.position.toArray(), scale: content.scale.x, turn: content.rotation.y }),
  /** Share of its timeline that the panel at the left wrist shows as played at a time; -1 where there is none. */
  async played(seconds: number): Promise<number> {
    time = seconds;
    await new Promise((done) => setTimeout(done, 300));
    await api.frames(2);
    let canvas: HTMLCanvasElement | undefined;
    root.traverseVisible((object) => {
      const image: unknown = object instanceof Mesh && object.material instanceof MeshBasicMaterial ? object.material.map?.image : null;
      if (image instanceof HTMLCanvasElement) canvas = image;
    });
    if (canvas === undefined) return -1;
    const { width } = canvas;
    const { data } = canvas.getContext("2d")!.getImageData(0, 74, width, 1);
    return Array.from({ length: width }, (_, x) => data[4 * x + 2]!).filter((blue) => blue > 200).length / (width - 48);
  },
  /** What the actions were told since the last call. */
  told: (): string[] => told.splice(0),
  active: (): boolean => device.activeSession !== undefined,
  pageFrames: () => pageFrames,
  rate: (): number => vr?.rate ?? 0,
};

export type SessionApi = typeof api;
declare global {
  interface Window {
    vr: SessionApi;
  }
}
window.vr = api;
