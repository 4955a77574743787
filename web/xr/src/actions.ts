// Wishes of a viewer in a headset. A separate module, so that a page can import it without three.js.

export interface VrActions {
  /** Plays, or pauses. */
  toggle(): void;
  step(frames: number): void;
  seekBy(seconds: number): void;
  /** Seconds from the start, and of how many. */
  time(): readonly [number, number];
}
