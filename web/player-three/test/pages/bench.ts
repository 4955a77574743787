// The page of bench.timed.test.ts: 50k vertices that move before 300k that do not, into 64 x 64 pixels.

import { PerspectiveCamera, Scene, WebGLRenderer } from "three";
import type { Shown } from "@meshreel/player-core/types";
import { Bench, ReelScene } from "../../src/index.ts";
import type { BenchReport } from "../../src/index.ts";
import { makeFloor, makeGroup } from "../analytic.ts";

const [RINGS, CELLS] = [158, 547]; // (158 + 1) x 2 x 158 and (547 + 1) squared vertices
const [FRAMES, FIRST, MEASURED] = [4, 10, 50];

const renderer = new WebGLRenderer({ antialias: false });
renderer.setSize(64, 64);
document.body.append(renderer.domElement);
const camera = new PerspectiveCamera(50, 1, 0.1, 500);
camera.position.set(0, 1, 3);
camera.lookAt(0, 0, 0);
const root = new Scene();
const scene = new ReelScene();
root.add(scene);

const group = makeGroup({ rings: RINGS, frameCount: FRAMES, squareFrame: -1 }).packed;
const background = makeFloor(CELLS).packed;

const api = {
  vertices: { moving: group.vertexCount, still: background.vertexCount },
  /** Shows and draws; what JavaScript does of it, the GPU's own work left aside. The first pictures, in which the browser compiles, do not count. */
  async measure(): Promise<BenchReport> {
    for (const packed of [group, background]) scene.prepare(packed, renderer);
    const gl = renderer.getContext();
    const bench = new Bench();
    for (let k = 0; k < FIRST + MEASURED; k++) {
      const frame = Math.floor(k / 3) % FRAMES;
      const shown: Shown = { frame, blend: (k % 3) / 3, frames: [frame], groups: [group], background, images: [null], backgroundImage: null };
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits, so that no call does for the last picture's
      await new Promise(requestAnimationFrame);
      const began = performance.now();
      scene.show(shown);
      renderer.render(root, camera);
      const ended = performance.now();
      if (k < FIRST) continue;
      bench.frameBegin(began);
      bench.frameEnd(ended);
    }
    const { gpuBytes, triangles } = scene;
    return bench.report({ gpuBytes, triangles, userAgent: navigator.userAgent, place: "page, 64 x 64" });
  },
  /** That there is a picture at all: pixels that are not the background's. */
  drawn(): number {
    renderer.render(root, camera);
    const gl = renderer.getContext();
    const pixels = new Uint8Array(4 * 64 * 64);
    gl.readPixels(0, 0, 64, 64, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let drawn = 0;
    for (let at = 0; at < pixels.length; at += 4) if (pixels[at] > 0) drawn++;
    return drawn;
  },
};

export type BenchApi = typeof api;
declare global {
  interface Window {
    bench: BenchApi;
  }
}
window.bench = api;
