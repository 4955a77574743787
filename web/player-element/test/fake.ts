// A playback and a stage that fetch, decode and draw nothing: what the element does with them can be seen from outside.

import { SourceError, type SourceErrorKind } from "@meshreel/player-core/errors";
import type { Direction, Info, Layers, Packed, Playback, Shown, Stats } from "@meshreel/player-core/types";
import type { Mode } from "@meshreel/player-three/modes";
import { GraphicsError } from "../src/stage.ts";
import type { Engine, Settings, Stage } from "../src/stage.ts";

export const INFO: Info = {
  frameCount: 48, frameRate: 24, duration: 2, origin: [0, 0, 0], box: { minimum: [-1, 0, -1], size: [2, 2, 2] }, trackCount: 1,
  mostLayers: 3, size: 123_456, hasColors: false, hasTextures: false, hasSplats: false, hasAudio: false, metadata: {},
};

/** Keeps time like a real one; a head comes after 10 ms, a seek takes 20 ms. An address with "404" in it fails. */
export class FakePlayback extends EventTarget implements Playback {
  info: Info | null = null;
  paused = true;
  ended = false;
  seeking = false;
  loop: boolean;
  direction: Direction;
  playbackRate: number;
  interpolate: boolean;
  textures: boolean;
  splats: boolean;
  layers: Layers;
  readonly sound = { muted: false, volume: 1, voice: null };
  stalled = false; // set by tests
  updates = 0;
  disposed = false;
  #time = 0;
  #isBack = false;
  #before: number | null = null;
  #shown: Shown | null = null;
  #timers: ReturnType<typeof setTimeout>[] = [];
  readonly source: string | Blob;

  constructor(source: string | Blob, settings: Settings) {
    super();
    this.source = source;
    this.loop = settings.loop;
    this.direction = settings.direction;
    this.playbackRate = settings.playbackRate;
    this.interpolate = settings.interpolate;
    this.textures = settings.textures;
    this.splats = settings.splats;
    this.layers = settings.layers;
    Object.assign(this.sound, { muted: settings.muted, volume: settings.volume });
    const bad = typeof source === "string" && source.includes("404");
    this.#later(10, () => (bad ? this.fail(`${String(source)}: not found (404), check the address`, "missing") : this.#head()));
  }

  get duration(): number {
    return this.info?.duration ?? 0;
  }
  get currentFrame(): number {
    return Math.min(INFO.frameCount - 1, Math.floor(this.#time * INFO.frameRate + 1e-6));
  }
  get currentTime(): number {
    return this.#time;
  }
  set currentTime(seconds: number) {
    this.#time = this.info ? Math.min(this.duration, Math.max(0, seconds)) : seconds;
    if (!this.info) return;
    this.ended = false;
    this.seeking = true;
    this.#tell("seeking");
    this.#later(20, () => {
      this.seeking = false;
      this.#tell("seeked");
      this.#tell("timeupdate");
    });
  }
  get stats(): Stats {
    return {
      mbps: 2.41, bandwidthMbps: 48.2, decodeMs: 12.3, decodeLoad: 0.08, bufferedSeconds: this.info ? 0.75 : 0, fetchedBytes: 61_000,
      layers: 3, wholeLayers: 3, stalls: 0, skippedGroups: 0,
      textures: "none", textureCodec: null, textureReason: "", backgroundLate: false,
    };
  }

  async play(): Promise<void> {
    if (this.ended) this.#time = 0;
    this.paused = this.ended = false;
    this.#before = null;
    this.#tell("play");
    if (this.info) this.#tell("playing");
  }
  pause(): void {
    if (this.paused) return;
    this.paused = true;
    this.#tell("pause");
  }
  step(frames: number): void {
    this.pause();
    this.currentTime = Math.min(INFO.frameCount - 1, this.currentFrame + frames) / INFO.frameRate;
  }

  update(now: number): Shown | null {
    this.updates++;
    if (!this.info) return null;
    if (!this.paused && !this.seeking && !this.stalled && this.#before !== null) {
      this.#isBack = this.direction === "reverse" || (this.direction === "alternate" && this.#isBack);
      this.#time += ((now - this.#before) / 1000) * this.playbackRate * (this.#isBack ? -1 : 1);
      if (this.#isBack ? this.#time <= 0 : this.#time >= this.duration) {
        if (this.direction === "alternate" && !this.#isBack) this.#isBack = true;
        else this.#end();
      }
    }
    this.#before = now;
    if (this.#shown?.frame !== this.currentFrame) this.#shown = { frame: this.currentFrame, blend: 0, frames: [this.currentFrame], groups: [null], background: null, images: [null], backgroundImage: null };
    return this.#shown;
  }

  dispose(): void {
    this.disposed = true;
    this.#timers.forEach(clearTimeout);
  }

  /** Fails as the network does. */
  fail(message: string, kind: SourceErrorKind = "unreachable"): void {
    const error = new SourceError(message, { kind });
    this.dispatchEvent(new CustomEvent("error", { detail: error }));
  }
  warn(message: string): void {
    this.dispatchEvent(new CustomEvent("warning", { detail: new Error(message) }));
  }

  #head(): void {
    this.info = INFO;
    this.#tell("loadedmetadata");
    this.#tell("progress");
    this.#tell("canplay");
    if (!this.paused) this.#tell("playing");
  }
  #end(): void {
    if (this.loop) {
      this.#time %= this.duration;
      return;
    }
    this.#time = this.duration;
    this.paused = this.ended = true;
    this.#tell("pause");
    this.#tell("ended");
  }
  #tell(type: string): void {
    this.dispatchEvent(new Event(type));
  }
  #later(ms: number, act: () => void): void {
    this.#timers.push(setTimeout(act, ms));
  }
}

/** Draws a turning square and the number of the frame. */
export class FakeStage extends EventTarget implements Stage {
  readonly canvas: HTMLCanvasElement;
  readonly stats = { triangles: 41_234, gpuBytes: 12_345_678, splats: 0, sortMs: 0, headsetRate: 0 };
  presenting = false;
  readonly far = new Set<number>();
  mode: Mode = "shaded";
  background = "";
  ground = true;
  exposure = 1;
  autoRotate = false;
  fly = false;
  isFit = true;
  up: Stage["up"] = null;
  camera = "1,1,1";
  viewOfFile = "1,2,3,0,1,0,45";
  draws = 0;
  fits = 0;
  disposed = false;
  prepared: Packed[] = [];
  frame: ((now: number) => void) | null = null;
  shown: Shown | null = null;

  constructor(canvas: HTMLCanvasElement) {
    super();
    this.canvas = canvas;
  }
  begin(): void {}
  prepare(packed: Packed): void {
    this.prepared.push(packed);
  }
  release(packed: Packed): void {
    this.prepared = this.prepared.filter((one) => one !== packed);
  }
  draw(shown: Shown | null): boolean {
    this.draws++;
    this.shown = shown;
    const context = this.canvas.getContext("2d")!;
    const { width, height } = this.canvas;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = this.background;
    context.fillRect(0, 0, width, height);
    if (!shown) return false;
    context.translate(width / 2, height / 2);
    context.rotate((shown.frame / INFO.frameCount) * Math.PI);
    context.fillStyle = this.mode === "shaded" ? "#8899aa" : "#44aa66";
    context.fillRect(-height / 4, -height / 4, height / 2, height / 2);
    return false;
  }
  resize(width: number, height: number, pixelRatio: number): void {
    this.canvas.width = width * pixelRatio;
    this.canvas.height = height * pixelRatio;
  }
  orbits: number[][] = [];
  orbit(...turn: number[]): void {
    this.orbits.push(turn);
  }
  fit(): void {
    this.fits++;
    this.dispatchEvent(new Event("change"));
  }
  picture(shown: Shown | null): Promise<Blob> {
    this.draw(shown);
    return new Promise((done) => this.canvas.toBlob((blob) => done(blob!), "image/png"));
  }
  async enterVr(frame: (now: number) => void): Promise<void> {
    this.presenting = true;
    this.frame = frame;
    this.dispatchEvent(new Event("vrstart"));
  }
  exitVr(): void {
    this.presenting = false;
    this.dispatchEvent(new Event("vrend"));
  }
  dispose(): void {
    this.disposed = true;
  }
}

/** Keeps all that it made. */
export class FakeEngine implements Engine {
  playbacks: FakePlayback[] = [];
  stages: FakeStage[] = [];
  webgl = true;
  load(): null {
    return null;
  }
  open(source: string | Blob, settings: Settings): FakePlayback {
    this.playbacks.push(new FakePlayback(source, settings));
    return this.playbacks.at(-1)!;
  }
  stage(canvas: HTMLCanvasElement): FakeStage {
    if (!this.webgl) throw new GraphicsError("WebGL 2 is not available");
    this.stages.push(new FakeStage(canvas));
    return this.stages.at(-1)!;
  }
}
