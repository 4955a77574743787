// Pictures of other times than the one that is shown, decoded beside playback from the first layer alone.

import type { Packed, Playback, Shown } from "@meshreel/player-core/types";
import type { Engine } from "./stage.ts";

export type Take = (canvas: HTMLCanvasElement, frame: number) => void;

/** What draws them, and takes back what it holds of them. */
export interface Easel {
  draw(shown: Shown): void;
  release(packed: Packed): void;
}

export class Glimpses {
  readonly #playback: Playback;
  #wanted: number | null = null; // s; the latest waits while another is sought, so that no more is asked for than can be shown

  /** Opens the source a second time. */
  constructor(engine: Engine, source: string | Blob, crossOrigin: string | null, easel: Easel) {
    this.#playback = engine.open(source, {
      layers: 0, interpolate: false, textures: false, splats: false, loop: false, direction: "normal", playbackRate: 1, muted: true, volume: 0, crossOrigin,
    });
    this.#playback.addEventListener("release", (event) => easel.release((event as CustomEvent<Packed>).detail));
    for (const type of ["canplay", "seeked"]) {
      this.#playback.addEventListener(type, () => {
        const shown = this.#playback.update(performance.now());
        if (shown) easel.draw(shown);
        this.#next();
      });
    }
  }

  want(time: number): void {
    if (this.#playback.info === null) {
      this.#playback.currentTime = time; // where it begins
      return;
    }
    this.#wanted = time;
    if (!this.#playback.seeking) this.#next();
  }

  dispose(): void {
    this.#playback.dispose(); // reports what to release
  }

  #next(): void {
    if (this.#wanted === null) return;
    this.#playback.currentTime = this.#wanted;
    this.#wanted = null;
  }
}
