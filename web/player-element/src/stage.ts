// Interfaces of the stage, which draws, and of the playback, which opens files, for the element, which knows no WebGL.

import type { Source } from "@meshreel/player-core/net/source";
import type { Direction, Info, Layers, Packed, Playback, Shown } from "@meshreel/player-core/types";
import type { Mode } from "@meshreel/player-three/modes";
import type { VrActions } from "@meshreel/xr/actions";
import type { Up } from "@meshreel/player-three/upright";

/** Numbers of the picture, for the overlay. */
export interface PictureStats {
  readonly triangles: number; // of the last picture
  readonly gpuBytes: number; // of buffers and textures
  readonly splats: number; // of the last picture
  readonly sortMs: number; // in a worker, of the last time that splats were ordered
  readonly headsetRate: number; // Hz of the headset that shows it; 0 on a page, and where the headset does not report it
}

/**
 * Draws packed groups into a canvas and moves a camera. Events:
 * `change` (a picture is wanted: the camera moved, a texture came, splats are in order), `camerachange`, `lost` and `restored` (the GPU's context),
 * `vrstart` and `vrend`.
 */
export interface Stage extends EventTarget {
  readonly canvas: HTMLCanvasElement;
  readonly stats: PictureStats;
  readonly presenting: boolean; // to a headset
  readonly far: ReadonlySet<number>; // tracks whose textures make no difference: they were drawn so small, or as splats
  mode: Mode;
  background: string; // a CSS colour
  autoRotate: boolean;
  fly: boolean; // the camera moves through the scene, instead of around what it looks at
  readonly isFit: boolean; // the view is the one that a recording begins with
  ground: boolean; // true for a ground, if the recording has none
  exposure: number; // times the usual light
  camera: string; // as the attribute has it; "" is the view that a recording begins with
  readonly viewOfFile: string; // the view of now as `meshreel tag --view` takes it; "" where there is no recording
  up: Up | null; // the recording's axis that points up; null: as it says itself. A change fits the view.
  /** A new recording: forgets the last one's groups, begins with its first view, or else a view of all of it. */
  begin(info: Info): void;
  prepare(packed: Packed): void;
  release(packed: Packed): void;
  /** Draws; true where the next picture will differ though time stands still (the camera glides). */
  draw(shown: Shown | null): boolean;
  /** All in CSS pixels; the lowest `covered` of them lie under the bar, and what is looked at is put into the middle of the others. */
  resize(width: number, height: number, pixelRatio: number, covered: number): void;
  /** The view that the recording begins with; where that is shown, all of it. */
  fit(): void;
  /** Turns the camera by radians, and divides its distance by `closer`. */
  orbit(right: number, up: number, closer: number): void;
  /** Draws, and gives what it drew as a PNG: what was drawn before is gone with the picture that showed it. */
  picture(shown: Shown | null): Promise<Blob>;
  /** From then on `draw` is called by the headset's frames, not by the page's. `passthrough`: in the viewer's own room. */
  enterVr(frame: (now: number) => void, actions: VrActions, passthrough: boolean): Promise<void>;
  exitVr(): void;
  dispose(): void;
}

export interface Settings {
  readonly layers: Layers;
  readonly interpolate: boolean;
  readonly textures: boolean;
  readonly splats: boolean;
  readonly loop: boolean;
  readonly direction: Direction;
  readonly playbackRate: number;
  readonly muted: boolean;
  readonly volume: number;
  readonly crossOrigin: string | null;
}

/** This browser cannot draw. */
export class GraphicsError extends Error {
  override name = "GraphicsError";
}

/** Factory of playbacks and stages; tests replace it. */
export interface Engine {
  open(source: string | Blob | Source, settings: Settings): Playback;
  /** Fetches what stages are made with; null where that is there. Rejects where it cannot be fetched. */
  load(): Promise<void> | null;
  /** To be called after `load`. Throws GraphicsError where there is no WebGL 2. */
  stage(canvas: HTMLCanvasElement): Stage;
}
