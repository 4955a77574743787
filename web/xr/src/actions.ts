// What a viewer in a headset asks for. By itself, so that a page knows it without three.js.

export interface VrActions {
  /** Plays, or pauses. */
  toggle(): void;
  step(frames: number): void;
  seekBy(seconds: number): void;
}
