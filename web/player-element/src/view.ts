// The picture: a canvas in a box, its stage, and the loop that draws only where something changed.

import type { Packed, Playback, Shown } from "@meshreel/player-core/types";
import type { Bench } from "@meshreel/player-three/bench";
import type { VrActions } from "@meshreel/xr/actions";
import { Glimpses, type Take } from "./glimpses.ts";
import type { Engine, Stage } from "./stage.ts";

/** A longer gap between two pictures is a page that was hidden or a machine that slept: time stood still meanwhile. */
const LONGEST_GAP = 1000; // ms
const MOST_TIMES = 150; // more than a headset shows in a second
const PICTURE = 1000 / 60; // ms

export class View {
  readonly stage: Stage;
  readonly canvas: HTMLCanvasElement;
  /** Pictures drawn since the view was made. */
  drawn = 0;
  #engine: Engine;
  #box: HTMLElement;
  #cover: HTMLElement;
  #report: (event: Event) => void;
  #playback: Playback | null = null;
  #last: Shown | null = null;
  #dirty = true;
  #onScreen = true;
  #handle = 0;
  #before: number | null = null; // when the last picture was due, of the page's or the headset's clock
  #clock = 0; // ms; the playback's own, that stands still while nothing can be drawn
  #times: number[] = []; // of the last pictures, ms
  #costs: number[] = []; // of JavaScript for them, ms
  #bench: Bench | null = null;
  #stop = new AbortController();
  #sizes: ResizeObserver;
  #sight: IntersectionObserver;

  /**
   * A canvas in `box`, over whose lower end `cover` lies. `report` gets `drawn` after each picture, and every event of the stage.
   * Throws where there is no WebGL 2.
   */
  constructor(engine: Engine, box: HTMLElement, cover: HTMLElement, report: (event: Event) => void) {
    this.#engine = engine;
    this.#box = box;
    this.#cover = cover;
    this.#report = report;
    this.canvas = document.createElement("canvas");
    this.canvas.part.add("canvas");
    this.stage = engine.stage(this.canvas);
    box.append(this.canvas);
    this.#sizes = new ResizeObserver(() => this.#resize());
    this.#sizes.observe(box);
    this.#sizes.observe(cover);
    this.#sight = new IntersectionObserver((entries) => this.#see(entries));
    this.#sight.observe(box);
    const { signal } = this.#stop;
    for (const type of ["change", "camerachange", "lost", "restored", "vrstart", "vrend"]) {
      this.stage.addEventListener(type, (event) => this.#onStage(event), { signal });
    }
    document.addEventListener("visibilitychange", () => this.refresh(), { signal });
    this.#resize();
  }

  /** Shows another playback from now on; null for an empty view. */
  show(playback: Playback | null): void {
    this.#playback = playback;
    this.#last = null;
    this.refresh();
  }

  /** Draws with the next picture whether or not something is known to have changed. */
  refresh(): void {
    this.#dirty = true;
    this.wake();
  }

  /** Looks with the next picture whether there is something new to draw. */
  wake(): void {
    if (this.#handle === 0 && !this.stage.presenting && !this.#stop.signal.aborted) {
      this.#handle = requestAnimationFrame(this.#frame);
    }
  }

  /** Pictures in the last second. */
  get fps(): number {
    const since = performance.now() - 1000;
    this.#times = this.#times.filter((time) => time > since);
    return this.#times.length;
  }

  /** JavaScript for a picture on the main thread, ms: the median of the last ones; 0 before the first. */
  get frameMs(): number {
    return [...this.#costs].sort((a, b) => a - b)[this.#costs.length >> 1] ?? 0;
  }

  /** True once something of the playback was drawn. */
  get shows(): boolean {
    return this.#last !== null;
  }

  /** The frame that was drawn last; -1 before the first. */
  get frame(): number {
    return this.#last?.frame ?? -1;
  }

  /** A PNG of the picture of this moment, whether or not it was drawn before. */
  picture(): Promise<Blob> {
    const shown = this.#playback?.update(this.#clock) ?? null; // the clock does not move
    if (shown) this.#last = shown;
    return this.stage.picture(this.#last);
  }

  /** Draws other times of a source for `take`; what is seen stays. */
  glimpses(source: string | Blob, crossOrigin: string | null, take: Take): Glimpses {
    const draw = (shown: Shown): void => {
      if (this.stage.presenting) return;
      this.stage.draw(shown);
      take(this.canvas, shown.frame);
      this.stage.draw(this.#last); // in the same task: the other is never seen
    };
    return new Glimpses(this.#engine, source, crossOrigin, { draw, release: (packed) => this.stage.release(packed) });
  }

  async enterVr(actions: VrActions, passthrough: boolean): Promise<void> {
    await this.stage.enterVr((now) => this.#tick(now), actions, passthrough);
  }

  /** Lets a bench collect from now on; what is given back ends that. */
  measure(playback: Playback, bench: Bench): () => void {
    const stop = new AbortController();
    const decoded = (event: Event): void => {
      const packed = (event as CustomEvent<Packed>).detail;
      if (packed.kind === "group") bench.decoded(packed.decodeMs, packed.frameCount / (playback.info?.frameRate ?? 30));
    };
    playback.addEventListener("ready", decoded, { signal: stop.signal });
    this.#bench = bench;
    return () => {
      stop.abort();
      this.#bench = null;
    };
  }

  dispose(): void {
    this.#stop.abort();
    cancelAnimationFrame(this.#handle);
    this.#sizes.disconnect();
    this.#sight.disconnect();
    this.#playback = null;
    this.#last = null;
    this.stage.dispose();
    this.canvas.remove();
  }

  #frame = (now: number): void => {
    this.#handle = 0;
    if (this.#tick(now)) this.wake();
  };

  #tick(now: number): boolean {
    const start = performance.now();
    const since = this.#before === null ? PICTURE : now - this.#before;
    this.#clock += since < 0 || since > LONGEST_GAP ? PICTURE : since;
    this.#before = now;
    const playback = this.#playback;
    const shown = playback?.update(this.#clock, this.stage.far) ?? null;
    const fresh = this.#dirty || this.stage.presenting || (shown !== null && shown !== this.#last);
    const moving = fresh && this.#draw(shown);
    if (shown) this.#last = shown;
    if (fresh) this.#measure(start);
    else this.#bench?.interrupt();
    return moving || this.#dirty || (playback !== null && goesOn(playback, this.#last));
  }

  #draw(shown: Shown | null): boolean {
    if (!this.#onScreen && !this.stage.presenting) {
      this.#dirty = false; // it is drawn when it comes into sight
      return false;
    }
    this.#dirty = false;
    if (shown) this.#last = shown;
    const moving = this.stage.draw(this.#last);
    this.#dirty ||= moving;
    this.drawn++;
    this.#report(new Event("drawn"));
    return moving;
  }

  #measure(start: number): void {
    const end = performance.now();
    this.#bench?.frameBegin(start);
    this.#bench?.frameEnd(end);
    this.#times.push(end);
    this.#costs.push(end - start);
    if (this.#times.length > MOST_TIMES) this.#times.shift();
    if (this.#costs.length > MOST_TIMES) this.#costs.shift();
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.#box;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.stage.resize(clientWidth, clientHeight, Math.min(devicePixelRatio, 2), this.#cover.offsetHeight);
    this.refresh();
  }

  #see(entries: readonly IntersectionObserverEntry[]): void {
    this.#onScreen = entries.at(-1)?.isIntersecting ?? true;
    if (this.#onScreen) this.refresh();
  }

  #onStage(event: Event): void {
    if (event.type === "vrstart" || event.type === "vrend") this.#before = null; // the headset's clock is another one
    this.#report(event);
    this.refresh();
  }
}

/** True where the next picture may differ without input: the player plays, seeks, or has shown nothing yet. */
export function goesOn(playback: Playback, shown: Shown | null): boolean {
  if (playback.info?.frameCount === 0) return false;
  return playback.seeking || !(playback.paused || playback.ended) || shown === null;
}
