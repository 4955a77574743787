// The slow video of a background: which of its pictures a frame is shown with. FORMAT.md, "Textures".

import type { CompanionChunk } from "../format/reader.ts";
import type { Place } from "./video_lane.ts";

/** Pictures of each layer but the last, as in format/layout.py. */
export const LAYER_PICTURES = 64;

export class SlowVideo {
  interval = 0; // frames from one picture to the next; 0: not known, before one layer was read
  #last = LAYER_PICTURES; // pictures of the last layer, at most
  readonly #layers: readonly CompanionChunk[];
  readonly #codedUntil: (frame: number) => number;
  readonly #frames: number;

  /** Of these layers, shown for a number of frames; `codedUntil`: coded frames from the first with it to one that is shown. */
  constructor(layers: readonly CompanionChunk[], codedUntil: (frame: number) => number, frames: number) {
    this.#layers = layers;
    this.#codedUntil = codedUntil;
    this.#frames = frames;
  }

  /** Learns from a layer. False where it breaks the laws of such videos. */
  read(layer: CompanionChunk, interval: number, pictures: number): boolean {
    const isLast = layer === this.#layers.at(-1);
    const isRight = interval > 0 && (this.interval === 0 || interval === this.interval);
    if (!isRight || pictures < 1 || pictures > LAYER_PICTURES || (!isLast && pictures < LAYER_PICTURES)) return false;
    this.interval = interval;
    if (isLast) this.#last = pictures;
    return true;
  }

  /** The picture of a frame; before one layer was read, the first of the layer that it is most likely in. */
  placeOf(frame: number): Place {
    const at = this.#codedUntil(frame);
    const last = this.#layers.length - 1;
    if (this.interval === 0) return { pictures: this.#layers[Math.min(last, Math.floor((at * (last + 1)) / this.#frames))], index: 0 };
    const picture = Math.floor(at / this.interval);
    const layer = Math.min(last, Math.floor(picture / LAYER_PICTURES));
    return { pictures: this.#layers[layer], index: Math.min(picture - LAYER_PICTURES * layer, (layer < last ? LAYER_PICTURES : this.#last) - 1) };
  }
}
