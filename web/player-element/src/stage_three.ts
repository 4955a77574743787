// A stage that draws with three.js.

import type { Info, Packed, Shown } from "@meshreel/player-core/types";
import { ReelScene } from "@meshreel/player-three";
import { Color, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Mode } from "./attributes.ts";
import type { PictureStats, Stage } from "./stage.ts";

export class ThreeStage extends EventTarget implements Stage {
  readonly canvas: HTMLCanvasElement;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #view = new PerspectiveCamera(45, 1, 0.01, 1000);
  readonly #orbit: OrbitControls;
  #reel = new ReelScene();
  readonly #stop = new AbortController();
  #info: Info | null = null;
  #shown: Shown | null = null;
  #mode: Mode = "shaded";
  #background = "";

  constructor(canvas: HTMLCanvasElement) {
    super();
    this.canvas = canvas;
    this.#renderer = makeRenderer(canvas);
    this.#scene.add(this.#reel);
    const { signal } = this.#stop;
    canvas.addEventListener("webglcontextlost", () => this.dispatchEvent(new Event("lost")), { signal });
    canvas.addEventListener("webglcontextrestored", () => this.dispatchEvent(new Event("restored")), { signal });
    this.#orbit = new OrbitControls(this.#view, canvas);
    this.#orbit.addEventListener("change", () => this.dispatchEvent(new Event("change")));
  }
  get stats(): PictureStats {
    return { triangles: this.#shown ? this.#reel.triangles : 0, gpuBytes: this.#reel.gpuBytes };
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
    this.#scene.background = new Color(colour);
  }
  get camera(): string {
    return [...this.#view.position.toArray(), ...this.#orbit.target.toArray()].map((v) => v.toFixed(3)).join(",");
  }
  set camera(text: string) {
    const v = text.split(",").map(Number);
    this.#view.position.set(v[0], v[1], v[2]);
    this.#orbit.target.set(v[3], v[4], v[5]);
    this.#orbit.update();
  }
  begin(info: Info): void {
    this.#reel.removeFromParent();
    this.#reel.dispose();
    this.#reel = new ReelScene();
    this.#reel.mode = this.#mode;
    this.#scene.add(this.#reel);
    this.#info = info;
    this.#shown = null;
    this.fit();
  }
  prepare(packed: Packed): void {
    this.#reel.prepare(packed, this.#renderer);
  }
  release(packed: Packed): void {
    this.#reel.release(packed);
  }
  draw(shown: Shown | null): boolean {
    this.#shown = shown;
    if (shown) this.#reel.show(shown);
    this.#reel.visible = shown !== null;
    this.#renderer.render(this.#scene, this.#view);
    return false;
  }
  resize(width: number, height: number, pixelRatio: number): void {
    this.#renderer.setPixelRatio(pixelRatio);
    this.#renderer.setSize(width, height, false);
    this.#view.aspect = width / height;
    this.#view.updateProjectionMatrix();
  }
  fit(): void {
    if (!this.#info) return;
    const { minimum, size } = this.#info.box;
    const c = [0, 1, 2].map((k) => minimum[k]! + size[k]! / 2);
    const r = Math.hypot(...size) / 2 || 1;
    this.#orbit.target.set(c[0]!, c[1]!, c[2]!);
    this.#view.position.set(c[0]! + r * 0.8, c[1]! + r * 0.8, c[2]! + r * 2);
    this.#orbit.update();
    this.dispatchEvent(new Event("change"));
  }
  picture(): Promise<Blob> {
    this.draw(this.#shown);
    return new Promise((done, fail) => this.canvas.toBlob((blob) => (blob ? done(blob) : fail(new Error("no picture"))), "image/png"));
  }
  async enterVr(): Promise<void> {}
  exitVr(): void {}
  dispose(): void {
    this.#stop.abort();
    this.#orbit.dispose();
    this.#reel.dispose();
    this.#renderer.dispose();
    this.#renderer.forceContextLoss();
  }
}

function makeRenderer(canvas: HTMLCanvasElement): WebGLRenderer {
  return new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
}
