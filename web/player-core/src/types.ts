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
  /** Null where there is no texture. */
  readonly places: PackedPlaces | null;
}

/** Places of triangles' corners in a texture. */
export interface PackedPlaces {
  readonly width: number; // of the texture, texels
  readonly height: number;
  /** Right and down from its upper left corner, in PLACE_SCALEths of its sides, for each corner of `faces`; NO_PLACE for those of a face that has none. */
  readonly faces: Uint16Array;
  readonly extra: Uint16Array; // of each corner of a group's `extra`
}

export const PLACE_SCALE = 65534;
export const NO_PLACE = 65535;

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
  readonly splats: PackedSplats | null; // shown in place of all surface but what single frames have alone
  readonly layers: number; // layers beyond the first that it was decoded from
  readonly bytes: number; // that it was decoded from
  readonly decodeMs: number;
}

/**
 * Splats of a group. Eight words each: the vertices of the corners of its face; the weights of the second and the third one, in SPLAT_WEIGHTths,
 * a half each; its offset along the normal, m, as float32; its turn from the direction of the face's first edge, in 65536ths of a full one, a
 * half, and the levels of its scales, a byte each; red, green, blue (sRGB) and its opacity, a byte each; and where from on, among these words,
 * the bits of the frames lie that lack it: 0 where none does.
 */
export interface PackedSplats {
  readonly count: number;
  readonly words: Uint32Array; // padded to SPLATS_WIDTH texels of four words
  readonly unit: number; // m: the scale of level 0; that of level k is 2^(-k/8) of it
}

export const SPLAT_WORDS = 8;
export const SPLAT_WEIGHT = 1 << 14;
export const SPLATS_WIDTH = 2048; // texels

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
 * The picture to draw now: a frame, the blend towards the next, and the available part of it. The same object as long as that is the
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
  /** For each track its texture in this frame, of the size that `places` of its group tells; null where it is shown in the colours of its vertices. */
  readonly images: readonly (TextureImage | null)[];
  readonly backgroundImage: TextureImage | null;
}

/** A decoded picture: a VideoFrame of the browser's, open as long as it is shown. */
export interface TextureImage {
  readonly displayWidth: number;
  readonly displayHeight: number;
  readonly timestamp: number;
  close(): void;
}

/**
 * State of the textures; if they are not shown, the reason: the file has none, they are switched off, the browser cannot decode them or not in time, they are
 * damaged, left out with layers, seen too small, or not decoded yet.
 */
export type TextureState = "shown" | "none" | "off" | "unsupported" | "slow" | "damaged" | "left out" | "far" | "late";

export interface TextureStats {
  readonly textures: TextureState;
  readonly textureCodec: "AV1" | "H.264" | null; // that they are decoded from; null where they are not
  readonly textureReason: string; // why it is not AV1 or there are none, where browser or machine is the cause
  readonly backgroundLate: boolean; // true if the background shows an earlier picture, or none
}

/** Companion of a chunk, which is shown without it if the companion is damaged. */
export type CompanionKind = "colors" | "atlas" | "splats" | Rendition;

/** Video from which textures are decoded: AV1, or the same pictures in H.264. */
export type Rendition = "pictures" | "compatible";

export type Point = readonly [number, number, number];

/** A camera that looks at a target, in the scene's own space. */
export interface FirstView {
  readonly position: Point;
  readonly target: Point;
  readonly fov: number; // degrees, of the picture's height
}

/** Facts from the head, known before any chunk is there. */
export interface Info {
  readonly frameCount: number;
  readonly frameRate: number; // 1/s
  readonly duration: number; // s, the last frame's own time included
  readonly origin: readonly [number, number, number]; // m, where the scene's own space has its zero
  readonly box: Box; // around all frames
  readonly rotation?: readonly number[] | null | undefined; // that frames are shown with, about the origin: nine numbers, row by row
  readonly view?: FirstView | null | undefined; // what it begins with; null where the file does not say
  readonly trackCount: number;
  readonly mostLayers: number; // layers beyond the first that the richest group has
  readonly size: number; // bytes
  readonly hasColors: boolean; // true if any of it has colours
  readonly hasTextures: boolean; // true if any colours are in textures
  readonly hasSplats: boolean; // true if any of it has splats
  readonly hasAudio: boolean; // true if it has sound
  readonly metadata: Readonly<Record<string, unknown>>;
}

/** Layers beyond the first that are played; "auto": the most that network and workers can sustain. */
export type Layers = number | "auto";

/** Limits of `Playback.playbackRate`. */
export const PLAYBACK_RATES = { least: 0.1, most: 4 } as const;

/** Numbers for the overlay. */
export interface Stats extends TextureStats {
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
  volumechange: Event; // or muting
  layerschange: Event;
  texturechange: Event; // a texture of what is shown came, or went
  ready: CustomEvent<Packed>; // decoded: upload it ahead of time
  release: CustomEvent<Packed>; // will not be shown again soon: free what was made of it
  warning: CustomEvent<Error>; // playback goes on: a damaged group is skipped, the network is tried again
  error: CustomEvent<Error>; // nothing more can be played
}

/** Directions of playback: to the end, to the start, or there and back; the words are those of CSS animations. */
export const DIRECTIONS = ["normal", "reverse", "alternate"] as const;
export type Direction = (typeof DIRECTIONS)[number];

/** Sound of a recording, if it has any. */
export interface Heard {
  muted: boolean; // set by itself, where the browser plays nothing aloud before the viewer has done something
  volume: number; // 0 to 1
  readonly voice: Pick<HTMLAudioElement, "currentTime" | "paused"> | null; // the audio element, once it can play
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
  readonly sound: Heard;
  currentTime: number; // s from the first frame; setting it seeks
  loop: boolean;
  direction: Direction; // backwards it is silent
  playbackRate: number; // within PLAYBACK_RATES
  interpolate: boolean; // blend between frames of a group
  layers: Layers;
  textures: boolean; // true if textures are fetched and shown
  splats: boolean; // true if splats are fetched
  play(): Promise<void>;
  pause(): void;
  /** Pauses and moves by a number of frames; a negative one goes back. */
  step(frames: number): void;
  /** To be called once a displayed picture, with a clock's milliseconds and the tracks that need no textures. Null where nothing can be shown yet. */
  update(now: number, far?: ReadonlySet<number>): Shown | null;
  dispose(): void;
}
