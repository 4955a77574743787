// Small pictures of what was shown, by their time: taken of pictures as they are drawn, so that they cost no decoding.

import { make } from "./dom.ts";

const HEIGHT = 72; // px
const COUNT = 60; // pictures of a recording, evenly in time (guess)

export class Thumbnails {
  /** Shows the last that was asked for. */
  readonly element = make("canvas", { class: "thumbnail", part: "thumbnail", "aria-hidden": "true" });
  #taken = new Map<number, OffscreenCanvas>();

  clear(): void {
    this.#taken.clear();
  }

  /** Keeps a picture that was drawn just now, unless there is one of about that time; shares of the duration. */
  take(canvas: HTMLCanvasElement, share: number): void {
    const place = Math.round(share * COUNT);
    if (this.#taken.has(place) || canvas.width === 0 || canvas.height === 0) return;
    const small = new OffscreenCanvas(Math.round((HEIGHT * canvas.width) / canvas.height), HEIGHT);
    small.getContext("2d")!.drawImage(canvas, 0, 0, small.width, HEIGHT);
    this.#taken.set(place, small);
  }

  /** Shows the picture of a time; false where none was taken within half a step of it. */
  show(share: number): boolean {
    const small = this.#taken.get(Math.round(share * COUNT));
    this.element.hidden = small === undefined;
    if (small === undefined) return false;
    [this.element.width, this.element.height] = [small.width, small.height];
    this.element.getContext("2d")!.drawImage(small, 0, 0);
    return true;
  }
}
