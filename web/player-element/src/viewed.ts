// Properties of an element's picture: camera, headset, screenshots.

import type { Glimpses, Take } from "./glimpses.ts";
import { arSupported, vrSupported } from "@meshreel/xr/supported";
import { Reflected } from "./reflected.ts";
import type { View } from "./view.ts";

export class Viewed extends Reflected {
  /** The picture; null before there is one. */
  protected view: View | null = null;
  /** A file that was opened; it stands in for `src`. */
  protected file: Blob | null = null;
  #glimpses: Glimpses | null = null;

  /** Position and target of the camera, as text for the attribute `camera`. */
  get camera(): string {
    return this.view?.stage.camera ?? this.getAttribute("camera") ?? "";
  }
  set camera(value: string) {
    this.setAttribute("camera", value);
  }
  /** The view of now, as `meshreel tag FILE --view` takes it; "" where nothing is shown. */
  get viewOfFile(): string {
    return this.view?.stage.viewOfFile ?? "";
  }
  /** True if the view is not the one that the recording begins with. */
  get cameraMoved(): boolean {
    return this.view !== null && !this.view.stage.isFit;
  }
  /** Looks from where the recording begins; from there, at the whole scene. */
  fit(): void {
    this.view?.stage.fit();
  }
  /** Turns the camera about what it looks at, in radians to the right and up, and divides its distance by `closer`. TypeError where they are no numbers. */
  orbit(right: number, up: number, closer = 1): void {
    if (![right, up, closer].every(Number.isFinite) || closer <= 0) throw new TypeError(`orbit(${right}, ${up}, ${closer}): finite numbers are needed, the last above 0`);
    this.view?.stage.orbit(right, up, closer);
  }
  /** A PNG of the picture as it is seen now. */
  async screenshot(): Promise<Blob> {
    if (!this.view) throw new DOMException("there is no picture yet", "InvalidStateError");
    return this.view.picture();
  }
  /** Has `take` get a picture of a time without seeking, decoded beside playback; of several that wait only the last. */
  glimpse(time: number, take: Take): void {
    if (!this.view || this.presenting) return;
    this.#glimpses ??= this.view.glimpses(this.file ?? this.src, this.crossOrigin, take);
    this.#glimpses.want(time);
  }
  /** Frees what glimpses were decoded with. */
  endGlimpses(): void {
    this.#glimpses?.dispose();
    this.#glimpses = null;
  }
  async vrSupported(): Promise<boolean> {
    return vrSupported();
  }
  async arSupported(): Promise<boolean> {
    return arSupported();
  }
  exitVr(): void {
    this.view?.stage.exitVr();
  }
  get presenting(): boolean {
    return this.view?.stage.presenting ?? false;
  }
}
