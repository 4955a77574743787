// The page of scene.browser.test.ts: a canvas of 320 x 240, a scene, and what the tests ask of them.

import { Color, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { PLACE_SCALE } from "@meshreel/player-core/types";
import type { Packed, PackedGroup, PackedStatic, Shown } from "@meshreel/player-core/types";
import { Ground, ReelScene } from "../../src/index.ts";
import type { Mode } from "../../src/index.ts";
import { readPositions } from "../../src/readback.ts";
import { makeFloor, makeGroup } from "../analytic.ts";

const [WIDTH, HEIGHT] = [320, 240];

const renderer = new WebGLRenderer({ antialias: false });
renderer.setSize(WIDTH, HEIGHT);
document.body.append(renderer.domElement);
const camera = new PerspectiveCamera(50, WIDTH / HEIGHT, 0.1, 20);
camera.position.set(0, 0, 3);
const root = new Scene();
root.background = new Color(0xffffff); // three forgets a clear colour with a lost context
let scene = new ReelScene();
root.add(scene);
const ground = new Ground();
let prepared: (PackedGroup | PackedStatic)[] = [];

function texelsOf(track: number): PackedGroup {
  const found = prepared.find((packed) => packed.kind === "group" && packed.track === track);
  if (found?.kind !== "group") throw new Error(`no group of track ${track}`);
  return found;
}

const api = {
  /** Prepares the moving sphere, the floor where asked, and a second track above where asked. */
  prepare(withFloor: boolean, secondTrack = false): void {
    prepared = [makeGroup().packed];
    if (secondTrack) prepared.push(makeGroup({ track: 1, squareFrame: -1, center: () => [0, 0.8, 0] }).packed);
    if (withFloor) prepared.push(makeFloor().packed);
    for (const packed of prepared) scene.prepare(packed, renderer);
  },
  /** Prepares the moving sphere and the floor with colours of their own, and a second track above without. */
  prepareColored(): void {
    prepared = [makeGroup({ isColored: true }).packed, makeGroup({ track: 1, squareFrame: -1, center: () => [0.9, 0.8, 0] }).packed, makeFloor(6, true).packed];
    for (const packed of prepared) scene.prepare(packed, renderer);
  },
  show(frame: number, blend = 0, held = frame): void {
    const groups = prepared.filter((packed) => packed.kind === "group");
    const background = prepared.find((packed) => packed.kind === "static") ?? null;
    const shown: Shown = { frame, blend, frames: groups.map(() => held), groups, background, images: groups.map(() => null), backgroundImage: null };
    scene.show(shown);
  },
  /** Shows the floor with a picture of so many texels, in stripes of two colours. */
  showStriped(side: number, stripe: number, colors: readonly [string, string]): void {
    const canvas = new OffscreenCanvas(side, side);
    const context = canvas.getContext("2d")!;
    for (let x = 0; x < side; x += stripe) {
      context.fillStyle = colors[(x / stripe) % 2];
      context.fillRect(x, 0, stripe, side);
    }
    const { packed, positions } = makeFloor();
    const across = (value: number): number => Math.round(PLACE_SCALE * (value / 3 + 0.5)); // of 3 m
    const faces = Uint16Array.from([...packed.faces].flatMap((vertex) => [across(positions[vertex][0]), across(positions[vertex][2])]));
    prepared = [{ ...packed, places: { width: side, height: side, faces, extra: new Uint16Array(0) } }];
    const image = new VideoFrame(canvas, { timestamp: 0 });
    scene.prepare(prepared[0], renderer);
    scene.show({ frame: 0, blend: 0, frames: [], groups: [], background: prepared[0] as PackedStatic, images: [], backgroundImage: image });
    renderer.render(root, camera);
    image.close();
  },
  look(mode: Mode, flat = false, exposure = 1): void {
    scene.exposure = exposure;
    scene.mode = mode;
    scene.flat = flat;
  },
  camera(x: number, y: number, z: number): void {
    camera.position.set(x, y, z);
    camera.lookAt(0, 0, 0);
  },
  /** Has the room's floor take the shadow of what moves. */
  shade(): void {
    ground.lie({ minimum: [-0.6, -0.5, -0.6], size: [1.2, 1, 1.2] });
    renderer.setClearAlpha(0); // as a player's has it
    ground.shade(scene, renderer, true);
  },
  /** Draws; the pixels, rows from the bottom, four bytes each, as base64. */
  draw(): string {
    renderer.render(root, camera);
    const gl = renderer.getContext();
    const pixels = new Uint8Array(4 * WIDTH * HEIGHT);
    gl.readPixels(0, 0, WIDTH, HEIGHT, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    if (gl.getError() !== gl.NO_ERROR) throw new Error("a WebGL error");
    let text = "";
    for (const byte of pixels) text += String.fromCharCode(byte);
    return btoa(text);
  },
  read(kind: "group" | "static", frame: number, blend: number): number[] {
    const packed = kind === "group" ? texelsOf(0) : prepared.find((other) => other.kind === "static");
    if (packed === undefined) throw new Error("no background");
    return [...readPositions(scene.prepare(packed, renderer), renderer, frame, blend)].map((value) => (Number.isNaN(value) ? -1e9 : value));
  },
  /** Positions of the vertices that a frame of any packed value draws, three numbers each. */
  readPacked(packed: Packed, frame: number): number[] {
    const positions = readPositions(scene.prepare(packed, renderer), renderer, frame, 0);
    scene.release(packed);
    return [...positions].filter((value) => !Number.isNaN(value));
  },
  numbers() {
    const { memory, programs } = renderer.info;
    return {
      gpuBytes: scene.gpuBytes, triangles: scene.triangles, textures: memory.textures, geometries: memory.geometries,
      programs: programs?.length ?? 0, calls: renderer.info.render.calls, drawn: renderer.info.render.triangles,
    };
  },
  release(): void {
    for (const packed of prepared) scene.release(packed);
    prepared = [];
  },
  renew(): void {
    scene.dispose();
    root.remove(scene);
    scene = new ReelScene();
    root.add(scene);
    prepared = [];
  },
  /** What is said of a group whose texture is too large. */
  refuse(): string {
    const packed = { ...makeGroup().packed, chunk: 7, textureWidth: 1_000_000, textureHeight: 1 };
    try {
      scene.prepare(packed, renderer);
    } catch (error) {
      return String(error);
    }
    return "nothing";
  },
  async loseContext(): Promise<void> {
    const extension = renderer.getContext().getExtension("WEBGL_lose_context");
    const event = (type: string) => new Promise((done) => renderer.domElement.addEventListener(type, done, { once: true }));
    const lost = event("webglcontextlost");
    extension?.loseContext();
    await lost;
    const restored = event("webglcontextrestored");
    await new Promise((done) => setTimeout(done, 50));
    extension?.restoreContext();
    await restored;
  },
  /** Names of the calls that bring data to the GPU, while a frame is shown and drawn. */
  uploadsWhileShowing(frame: number): string[] {
    const gl = renderer.getContext() as unknown as Record<string, (...values: unknown[]) => unknown>;
    const seen: string[] = [];
    const names = ["bufferData", "bufferSubData", "texImage2D", "texSubImage2D", "texStorage2D", "compileShader"];
    for (const name of names) {
      const own = gl[name];
      gl[name] = (...values) => {
        seen.push(name);
        return own.apply(gl, values);
      };
    }
    api.show(frame);
    renderer.render(root, camera);
    for (const name of names) delete gl[name];
    return seen;
  },
};

export type SceneApi = typeof api;
declare global {
  interface Window {
    api: SceneApi;
  }
}
window.api = api;
