// Small pictures by their time: taken of pictures as they are drawn; of times that were not shown, of glimpses.

import { make } from "./dom.ts";

const HEIGHT = 72; // px
const MOST = 60; // pictures of a recording, evenly in time (guess)

export class Thumbnails {
  /** Shows the last that was asked for. */
  readonly element = make("canvas", { class: "thumbnail", part: "thumbnail", "aria-hidden": "true" });
  #taken = new Map<number, OffscreenCanvas>();

  clear(): void {
    this.#taken.clear();
  }

  /** Keeps a picture that was drawn just now, unless there is one of about that time. */
  take(canvas: HTMLCanvasElement, frame: number, frameCount: number): void {
    const place = placeOf(frame / frameCount, frameCount);
    if (this.#taken.has(place) || canvas.width === 0 || canvas.height === 0) return;
    const small = new OffscreenCanvas(Math.round((HEIGHT * canvas.width) / canvas.height), HEIGHT);
    small.getContext("2d")!.drawImage(canvas, 0, 0, small.width, HEIGHT);
    this.#taken.set(place, small);
  }

  /** Shows the picture of a share of the duration; where there is none, returns that of which one would be shown here. */
  show(share: number, frameCount: number): number | null {
    const place = placeOf(share, frameCount);
    const small = this.#taken.get(place);
    this.element.hidden = small === undefined;
    if (small === undefined) return (place + 0.5) / Math.min(MOST, frameCount);
    [this.element.width, this.element.height] = [small.width, small.height];
    this.element.getContext("2d")!.drawImage(small, 0, 0);
    return null;
  }
}

function placeOf(share: number, frameCount: number): number {
  const count = Math.min(MOST, frameCount);
  return Math.min(count - 1, Math.floor(share * count + 1e-6));
}
