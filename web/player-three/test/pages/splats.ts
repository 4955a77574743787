// The page of splats.browser.test.ts: a canvas, a scene whose splats are ordered in a worker, and what the tests ask of them.

import { Color, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import type { Packed, PackedGroup } from "@meshreel/player-core/types";
import { ReelScene, Sorter } from "../../src/index.ts";
import type { Mode, OrderWorker } from "../../src/index.ts";

const renderer = new WebGLRenderer({ antialias: false });
document.body.append(renderer.domElement);
const camera = new PerspectiveCamera(50, 1, 0.1, 20);
const root = new Scene();
root.background = new Color(0xffffff);
const sorter = new Sorter(() => new Worker(new URL("../../src/order_worker.ts", import.meta.url), { type: "module" }) as OrderWorker);
const scene = new ReelScene(sorter);
root.add(scene);

const splatApi = {
  size(width: number, height: number): void {
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
  },
  camera(x: number, y: number, z: number): void {
    camera.position.set(x, y, z);
    camera.lookAt(0, 0, 0);
  },
  prepare(packed: readonly Packed[], mode: Mode): void {
    scene.mode = mode;
    for (const one of packed) scene.prepare(one, renderer);
  },
  release(packed: readonly Packed[]): void {
    for (const one of packed) scene.release(one);
  },
  show(packed: readonly Packed[], frame: number): void {
    const groups = packed.filter((one): one is PackedGroup => one.kind === "group");
    const background = packed.find((one) => one.kind === "static") ?? null;
    scene.show({ frame, blend: 0, frames: groups.map(() => frame), groups, background, images: groups.map(() => null), backgroundImage: null });
    renderer.render(root, camera);
  },
  /** Shows a frame until its splats are in order; the pixels, rows from the bottom, four bytes each, as base64. */
  async draw(packed: readonly Packed[], mode: Mode, frame: number): Promise<string> {
    splatApi.prepare(packed, mode);
    const isOrdered = new Promise<void>((done) => (sorter.onorder = done));
    splatApi.show(packed, frame);
    if (scene.splats.some((count) => count > 0)) await isOrdered;
    splatApi.show(packed, frame);
    const gl = renderer.getContext();
    const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
    gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    if (gl.getError() !== gl.NO_ERROR) throw new Error("a WebGL error");
    splatApi.release(packed);
    return btoa(pixels.reduce((text, byte) => text + String.fromCharCode(byte), ""));
  },
  /** Turns around what is shown, a picture a call: how many pictures a second, ms of an order, and bytes uploaded a picture. */
  async measure(packed: readonly Packed[], frames: number, pictures: number): Promise<{ rate: number; sortMs: number[]; bytes: number; vertices: number }> {
    splatApi.prepare(packed, "splats");
    const gl = renderer.getContext();
    const own = gl.bufferSubData.bind(gl);
    let bytes = 0;
    gl.bufferSubData = (...values: unknown[]) => {
      const [, , data, , length] = values as [number, number, { BYTES_PER_ELEMENT: number; length: number }, number?, number?];
      bytes += data.BYTES_PER_ELEMENT * (length ?? data.length);
      (own as (...all: unknown[]) => void)(...values);
    };
    const sortMs: number[] = [];
    splatApi.show(packed, 0);
    await new Promise<void>((done) => (sorter.onorder = done));
    const pixel = new Uint8Array(4);
    bytes = 0;
    const start = performance.now();
    for (let k = 0; k < pictures; k++) {
      const isOrdered = new Promise<void>((done) => (sorter.onorder = done));
      splatApi.camera(3 * Math.sin(0.3 * k), 0.2, 3 * Math.cos(0.3 * k));
      splatApi.show(packed, k % frames);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits for the picture
      await isOrdered;
      sortMs.push(sorter.lastMs);
    }
    const rate = (1000 * pictures) / (performance.now() - start);
    const vertices = 3 * scene.splats.reduce((sum, count) => sum + count, 0);
    splatApi.release(packed);
    return { rate, sortMs, bytes: bytes / pictures, vertices };
  },
};

export type SplatApi = typeof splatApi;
declare global {
  interface Window {
    splatApi: SplatApi;
  }
}
window.splatApi = splatApi;
