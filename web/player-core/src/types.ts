// The vocabulary: values that pass between workers, player and renderer. Nothing here knows the DOM or WebGL.

/** A box in the scene's own space: metres from `Info.origin`, right-handed, y up as in the file. */
export interface Box {
  readonly minimum: readonly [number, number, number];
  readonly size: readonly [number, number, number];
}

/**
 * Vertices as the GPU takes them: four uint16 each, x, y, z in 65535ths of the box and a normal.
 *
 * The normal is octahedral, its first number in the low byte, its second in the high one; (0, 0, 0) has no code and is
 * kept as +z.
 */
export interface PackedVertices {
  readonly texels: Uint16Array;
  /** Red, green and blue (sRGB) and 255, a texel for each of `texels` and in their order; null where there are no colours. */
  readonly colors: Uint8Array | null;
  readonly box: Box;
}

/** A decoded group of frames of one track, ready for upload. All buffers are its own, so that they can be transferred. */
export interface PackedGroup extends PackedVertices {
  readonly kind: "group";
  readonly chunk: number;
  readonly track: number;
  readonly firstFrame: number;
  readonly frameCount: number; // T
  /** V: vertices that are there in every frame; only these move between frames. */
  readonly vertexCount: number;
  /**
   * Texels: vertex v < V of frame t is texel t * V + v. Behind these T * V are the vertices that one frame has alone; index V + j in
   * `faces` or `extra` is texel T * V + j, whatever the frame. Padded to `textureWidth` x `textureHeight`.
   */
  readonly textureWidth: number;
  readonly textureHeight: number;
  /** Corners of the triangles that every frame shows. */
  readonly faces: Uint32Array;
  /** Corners of the additional faces of single frames: frame t has extra[extraStarts[t]] up to extra[extraStarts[t + 1]]. */
  readonly extra: Uint32Array;
  readonly extraStarts: Uint32Array; // T + 1 numbers
  readonly layers: number; // layers beyond the first that it was decoded from
  readonly bytes: number; // that it was decoded from
  readonly decodeMs: number;
}

/** A decoded state of the background. Texels: one a vertex, without padding. */
export interface PackedStatic extends PackedVertices {
  readonly kind: "static";
  readonly chunk: number;
  readonly vertexCount: number;
  readonly faces: Uint32Array;
  readonly bytes: number;
  readonly decodeMs: number;
}

export type Packed = PackedGroup | PackedStatic;

/**
 * What to draw now: a frame, how far to blend towards the next, and what is at hand of it. The same object as long as that is the
 * same; one that was replaced stays as it is until the next is asked for, and may be used again then.
 */
export interface Shown {
  readonly frame: number;
  /** 0 to 1 towards frame + 1; 0 where that is in another group in all tracks, or where interpolation is off. A track whose group ends here stands. */
  readonly blend: number;
  /** For each track the frame that it shows: `frame`, or where that is damaged the one that it showed last. Such a track stands. */
  readonly frames: readonly number[];
  /** For each track, the group of its frame; null where it is empty, or damaged and nothing was shown before. */
  readonly groups: readonly (PackedGroup | null)[];
  /** The state of this frame; where that is damaged the one that was shown last. */
  readonly background: PackedStatic | null;
}

/** What a chunk may add to another one, which is shown without it where it is damaged. */
export type CompanionKind = "colors";

/** What is known from the head, before any chunk is there. */
export interface Info {
  readonly frameCount: number;
  readonly frameRate: number; // 1/s
  readonly duration: number; // s, the last frame's own time included
  readonly origin: readonly [number, number, number]; // m, where the scene's own space has its zero
  readonly box: Box; // around all frames
  readonly trackCount: number;
  readonly mostLayers: number; // layers beyond the first that the richest group has
  readonly size: number; // bytes
  readonly hasColors: boolean; // whether some of it has colours of its own
  readonly metadata: Readonly<Record<string, unknown>>;
}

/** Layers beyond the first that are played; "auto": the most that network and workers can sustain. */
export type Layers = number | "auto";

/** What `Playback.playbackRate` may be. */
export const PLAYBACK_RATES = { least: 0.1, most: 4 } as const;

/** Numbers for the overlay. */
export interface Stats {
  readonly mbps: number; // of the stream with the layers that play, over its own time
  readonly bandwidthMbps: number; // as measured while fetching; 0 before the first chunk
  readonly decodeMs: number; // of the last group
  readonly decodeLoad: number; // decoding time over playing time of the last groups; above 1 is too slow
  readonly bufferedSeconds: number; // decoded ahead of the current time
  readonly fetchedBytes: number;
  readonly layers: number; // layers beyond the first of the groups shown
  readonly wholeLayers: number; // those that these groups have in the file, where it may have fewer than `Info.mostLayers`
  readonly stalls: number;
  readonly skippedGroups: number; // damaged ones
}

/** Events of a `Playback`, as a media element has them; those that are its own carry a `detail`. */
export interface PlaybackEvents {
  loadedmetadata: Event;
  canplay: Event; // the first frame is at hand
  play: Event;
  playing: Event;
  pause: Event;
  waiting: Event; // a stall: the next frame is not at hand
  seeking: Event;
  seeked: Event;
  timeupdate: Event;
  progress: Event; // bytes have come
  ended: Event;
  ratechange: Event;
  layerschange: Event;
  ready: CustomEvent<Packed>; // decoded: upload it ahead of time
  release: CustomEvent<Packed>; // will not be shown again soon: free what was made of it
  warning: CustomEvent<Error>; // playback goes on: a damaged group is skipped, the network is tried again
  error: CustomEvent<Error>; // nothing more can be played
}

/** A player without a picture: it fetches, decodes and keeps time. `Player` in player.ts is the one there is. */
export interface Playback extends EventTarget {
  readonly info: Info | null;
  readonly duration: number; // s; 0 before the head is there
  readonly paused: boolean;
  readonly ended: boolean;
  readonly seeking: boolean;
  readonly currentFrame: number;
  readonly stats: Stats;
  currentTime: number; // s from the first frame; setting it seeks
  loop: boolean;
  playbackRate: number; // within PLAYBACK_RATES
  interpolate: boolean; // blend between frames of a group
  layers: Layers;
  play(): Promise<void>;
  pause(): void;
  /** Pauses and moves by a number of frames; a negative one goes back. */
  step(frames: number): void;
  /** To be called once a displayed picture, with a clock's milliseconds. Null where nothing can be shown yet. */
  update(now: number): Shown | null;
  dispose(): void;
}
