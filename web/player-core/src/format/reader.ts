// The head of a .reel file, checked, and where everything else lies. Beside container/reader.py.
// In: the first bytes of a file. Out: chunks by number, by frame and by what they need. Fetches nothing itself.

import { checkHeader, checkIndex, metadataOf } from "./checks.ts";
import { crc32 } from "./crc.ts";
import { checkFrames } from "./budget.ts";
import { codedFrame, editOf, placed } from "./edit.ts";
import type { Edit } from "./edit.ts";
import { FormatError } from "../errors.ts";
import { Checksum, ChunkKind, EDITED, Form, Header, Index, LIMITS, MAGIC, Preamble, VERSION } from "./layout.gen.ts";
import type { Layer } from "./layout.gen.ts";
import { unpack, unpackAll } from "./records.ts";
import { viewOf } from "./view.ts";
import type { Box, CompanionKind, Info, Rendition } from "../types.ts";

export const FIRST_REQUEST = 16384; // bytes; the head of some minutes of video
const PREAMBLE_SIZE = Preamble.least;
/** Videos of textures, the one that is wanted first before the other. */
export const RENDITIONS: readonly Rendition[] = ["pictures", "compatible"];

/** Position and contents of a chunk. */
export interface Chunk {
  readonly number: number;
  /** Companions come with a chunk of frames or of the background, and add to it; "unknown": what this player does not decode, and never fetches. */
  readonly kind: "static" | "group" | CompanionKind | "audio" | "unknown";
  readonly form: number;
  readonly track: number; // 0 for static
  readonly firstFrame: number; // of a group and of its companions; numbered as the frames that it shows
  readonly frameCount: number; // of a group and of its companions
  readonly coded: number; // of a group, the number of its first frame among the coded ones
  readonly shownFirst: number; // of a group, the first frame of it that is shown
  readonly shownEnd: number; // and the frame behind the last
  readonly dependsOn: readonly number[]; // of a static chunk, and where it is predicted of the group before it; of a companion, as FORMAT.md says
  readonly offset: number; // bytes from the start of the file
  readonly size: number; // bytes of all layers
  readonly layers: readonly Layer[];
}

/** A chunk that adds to another one. */
export type CompanionChunk = Chunk & { readonly kind: CompanionKind };

export class Head {
  readonly info: Info;
  readonly tracks: readonly (readonly Chunk[])[]; // the groups of each
  private readonly shownGroups: readonly (readonly Chunk[])[]; // of each track, those of which frames are shown
  /** Unit of fetching, in the order of the file: a chunk, or a layer of a background's pictures, which is a separate video. */
  readonly pieces: readonly Chunk[];
  readonly audio: Chunk | null; // the audio file
  private readonly companions = new Map<number, readonly CompanionChunk[]>(); // by the chunk that they add to
  private readonly shown = new Map<number, Chunk>(); // of each static chunk, the first group that names it
  private readonly times: Float64Array; // s from the first frame; empty where they follow from the rate

  private constructor(
    readonly header: Header,
    readonly chunks: readonly Chunk[],
    metadata: Record<string, unknown>,
    private readonly edit: Edit,
  ) {
    this.tracks = byTrack(chunks);
    this.shownGroups = this.tracks.map((groups) => groups.filter(({ shownFirst, shownEnd }) => shownFirst < shownEnd));
    this.audio = chunks.find(({ kind }) => kind === "audio") ?? null;
    for (const chunk of chunks) if (isCompanion(chunk)) this.companions.set(chunk.dependsOn[0], [...this.companionsOf(chunks[chunk.dependsOn[0]]), chunk]);
    this.pieces = chunks.flatMap((chunk) => (isVideo(chunk) && chunk.frameCount === 0 ? layersOf(chunk) : [chunk]));
    for (const chunk of chunks) if (chunk.kind === "group") for (const other of chunk.dependsOn) if (!this.shown.has(other)) this.shown.set(other, chunk);
    const frameCount = edit.shown.reduce((sum, [first, end]) => sum + end - first, 0);
    checkHeader(header, frameCount);
    const end = chunks[chunks.length - 1];
    if (end.offset + end.size > Number.MAX_SAFE_INTEGER) throw new FormatError(`a file of ${end.offset + end.size} bytes, beyond 53 bits`);
    checkFrames(codedFrames(chunks) * this.tracks.length, end.offset + end.size);
    this.times = timesOf(header.intervals);
    this.info = infoOf(header, chunks, metadata, edit.rotation, this.tracks.length, frameCount, this.timestampOf(frameCount - 1));
  }

  /** Bytes of the head, from the first 14 bytes of a file. FormatError where it is none, or of an unknown version. */
  static sizeOf(start: Uint8Array): number {
    if (start.length < PREAMBLE_SIZE || !MAGIC.every((byte, k) => start[k] === byte)) {
      throw new FormatError("not a .reel file: the signature is missing", "foreign");
    }
    const [preamble] = unpack(Preamble, start);
    if (preamble.version !== VERSION) {
      throw new FormatError(`format version ${preamble.version}: this player knows version ${VERSION}, update it`, "newer");
    }
    if (preamble.flags & ~EDITED) throw new FormatError(`flags ${preamble.flags}: this player knows ${EDITED} alone, update it`, "newer");
    if (preamble.headSize < PREAMBLE_SIZE + Checksum.least) throw new FormatError(`a head of ${preamble.headSize} bytes: damaged`);
    if (preamble.headSize > LIMITS.head) throw new FormatError(`a head of ${preamble.headSize} bytes, over ${LIMITS.head}`);
    return preamble.headSize;
  }

  /** The head, from its bytes; those behind it are left alone. FormatError where it is damaged or not whole. */
  static parse(data: Uint8Array): Head {
    const size = Head.sizeOf(data);
    const end = size - Checksum.least;
    if (data.length < size || unpackAll(Checksum, data.subarray(end, size)).crc !== crc32(data.subarray(0, end))) {
      throw new FormatError("the head is damaged: its checksum does not match");
    }
    const [header, start] = unpack(Header, data.subarray(0, end), PREAMBLE_SIZE);
    const index = unpackAll(Index, data.subarray(start, end));
    checkIndex(index);
    const metadata = metadataOf(header.metadata);
    const frames = index.chunks.reduce((sum, entry) => sum + (entry.kind === ChunkKind.GROUP && entry.track === 0 ? entry.frames : 0), 0);
    const edit = editOf(metadata, unpack(Preamble, data)[0].flags, frames);
    return new Head(header, chunksOf(index, size, edit), metadata, edit);
  }

  /** Bytes of the whole file. */
  get size(): number {
    return this.info.size;
  }

  get frameCount(): number {
    return this.info.frameCount;
  }

  /** The time of a frame, s from the first one. RangeError outside 0 .. frameCount - 1. */
  timestamp(frame: number): number {
    this.checkFrame(frame);
    return this.timestampOf(frame);
  }

  /** The group of a track that holds a frame. RangeError outside 0 .. frameCount - 1. */
  chunkOfFrame(frame: number, track: number): Chunk {
    this.checkFrame(frame);
    const groups = this.shownGroups[track];
    let [low, high] = [0, groups.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (groups[middle].shownFirst <= frame) low = middle;
      else high = middle - 1;
    }
    return groups[low];
  }

  /** The state of the background that a frame is shown with: the newest that a group of it names. */
  staticOfFrame(frame: number): Chunk | null {
    let newest = -1;
    for (let track = 0; track < this.tracks.length; track++) {
      for (const number of this.chunkOfFrame(frame, track).dependsOn) {
        if (this.chunks[number].kind === "static") newest = Math.max(newest, number);
      }
    }
    return newest < 0 ? null : this.chunks[newest];
  }

  /** The group that one is predicted from. */
  groupBefore(chunk: Chunk): Chunk | null {
    const number = chunk.dependsOn.find((other) => this.chunks[other].kind === "group");
    return number === undefined ? null : this.chunks[number];
  }

  /** The state that a static chunk of form PATCH changes. */
  changedFrom(chunk: Chunk): Chunk | null {
    return chunk.kind === "static" && chunk.dependsOn.length > 0 ? this.chunks[chunk.dependsOn[0]] : null;
  }

  /** The chunks that add to one: its colours, its atlas and pictures, its splats. */
  companionsOf(chunk: Chunk): readonly CompanionChunk[] {
    return this.companions.get(chunk.number) ?? [];
  }

  /** The layers of a background's pictures. */
  piecesOf(pictures: CompanionChunk): readonly CompanionChunk[] {
    return this.pieces.filter(({ number }) => number === pictures.number) as CompanionChunk[];
  }

  /** The first frame that is shown with a static chunk; the number of frames where none is. */
  shownFrom({ number }: Chunk): number {
    return this.shown.get(number)?.firstFrame ?? this.frameCount;
  }

  /** The companion that one is predicted from, or that has the colours of what a change of the background keeps; of the first pictures, their atlas. */
  companionBefore(chunk: Chunk): Chunk | null {
    const of = this.chunks[chunk.dependsOn[0]];
    const changed = this.changedFrom(of);
    if (changed !== null) return this.companionsOf(changed).find(({ kind }) => kind === chunk.kind) ?? null;
    return chunk.dependsOn.length > 1 ? this.chunks[chunk.dependsOn[chunk.dependsOn.length - 1]] : null;
  }

  /** Coded frames from the first that is coded with a static chunk to a frame that is shown with it. */
  framesWith({ number }: Chunk, frame: number): number {
    return codedFrame(this.edit, frame) - (this.shown.get(number)?.coded ?? 0);
  }

  private checkFrame(frame: number): void {
    if (!(frame >= 0 && frame < this.frameCount)) throw new RangeError(`frame ${frame}: the file has frames 0 to ${this.frameCount - 1}`);
  }

  private timestampOf(frame: number): number {
    return this.times.length > 0 ? this.times[frame] : frame / this.header.frameRate;
  }
}

/** True if a chunk is a companion of another one. */
export function isCompanion(chunk: Chunk): chunk is CompanionChunk {
  return isCompanionKind(chunk.kind);
}

function isCompanionKind(kind: Chunk["kind"]): kind is CompanionKind {
  return ["colors", "atlas", "splats", ...RENDITIONS].includes(kind);
}

/** True if a chunk has textures. */
export function isVideo(chunk: Chunk): chunk is Chunk & { readonly kind: Rendition } {
  return RENDITIONS.includes(chunk.kind as Rendition);
}

/** The layers of a chunk, each like a chunk of the same number. */
function layersOf(chunk: Chunk): Chunk[] {
  let end = chunk.offset;
  return chunk.layers.map((layer) => ({ ...chunk, offset: (end += layer.size) - layer.size, size: layer.size, layers: [layer] }));
}

/** "chunk 3 (track 0, frames 10 to 19)", for messages. */
export function describe(chunk: Pick<Chunk, "number" | "kind" | "track" | "firstFrame" | "frameCount">): string {
  const { number, kind, track, firstFrame, frameCount } = chunk;
  if (kind === "audio") return `chunk ${number} (audio)`;
  if (kind === "unknown") return `chunk ${number} (of another kind)`;
  const what = isCompanionKind(kind) ? `${kind}, ` : "";
  if (frameCount === 0) return `chunk ${number} (${what}static)`;
  return `chunk ${number} (${what}track ${track}, frames ${firstFrame} to ${firstFrame + frameCount - 1})`;
}

/** The chunks of a file, which lie behind each other from `start`. */
function chunksOf(index: Index, start: number, edit: Edit): Chunk[] {
  const frames: number[] = [];
  const chunks: Chunk[] = [];
  let offset = start;
  index.chunks.forEach((entry, number) => {
    const kind = kindOf(entry.kind);
    const size = entry.layers.reduce((sum, layer) => sum + layer.size, 0);
    const { form, track, dependsOn, layers } = entry;
    let place = { firstFrame: isCompanionKind(kind) ? chunks[dependsOn[0]].firstFrame : 0, shownFirst: 0, shownEnd: 0 };
    const coded = kind === "group" ? (frames[track] ?? 0) : 0;
    if (kind === "group") {
      place = placed(edit, coded, entry.frames);
      frames[track] = coded + entry.frames;
    }
    chunks.push({ number, kind, form, track, coded, ...place, frameCount: entry.frames, dependsOn, offset, size, layers });
    offset += size;
  });
  return chunks;
}

function kindOf(kind: number): Chunk["kind"] {
  switch (kind) {
    case ChunkKind.STATIC:
      return "static";
    case ChunkKind.GROUP:
      return "group";
    case ChunkKind.COLORS:
      return "colors";
    case ChunkKind.ATLAS:
      return "atlas";
    case ChunkKind.PICTURES:
      return "pictures";
    case ChunkKind.COMPATIBLE:
      return "compatible";
    case ChunkKind.SPLATS:
      return "splats";
    case ChunkKind.AUDIO:
      return "audio";
    default:
      return "unknown";
  }
}

function byTrack(chunks: readonly Chunk[]): Chunk[][] {
  const tracks: Chunk[][] = [];
  for (const chunk of chunks) if (chunk.kind === "group") (tracks[chunk.track] ??= []).push(chunk);
  return tracks;
}

function timesOf(intervals: readonly number[]): Float64Array {
  if (intervals.length === 0) return new Float64Array(0);
  const times = new Float64Array(intervals.length + 1);
  let sum = 0;
  intervals.forEach((interval, k) => {
    sum += interval;
    times[k + 1] = sum / 1e6;
  });
  return times;
}

function codedFrames(chunks: readonly Chunk[]): number {
  return chunks.reduce((sum, { kind, track, frameCount }) => sum + (kind === "group" && track === 0 ? frameCount : 0), 0);
}

function infoOf(
  header: Header, chunks: readonly Chunk[], metadata: Record<string, unknown>, rotation: Info["rotation"], trackCount: number, frameCount: number, lastTime: number,
): Info {
  const last = chunks[chunks.length - 1];
  const scaled = chunks.filter(({ kind, form }) => kind === "group" && (form === Form.LAYERS || form === Form.LAPLACIAN));
  const turned = rotation ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
  return {
    frameCount,
    frameRate: header.frameRate,
    duration: lastTime + 1 / header.frameRate,
    origin: header.origin as unknown as Info["origin"],
    box: boxOf(header, turned),
    rotation,
    view: viewOf(metadata, header.scale, turned),
    trackCount,
    mostLayers: scaled.reduce((most, chunk) => Math.max(most, chunk.layers.length - 1), 0),
    size: last.offset + last.size,
    hasColors: chunks.some((chunk) => chunk.kind === "colors" || isVideo(chunk)),
    hasTextures: chunks.some(isVideo),
    hasSplats: chunks.some((chunk) => chunk.kind === "splats"),
    hasAudio: chunks.some((chunk) => chunk.kind === "audio"),
    metadata,
  };
}

/** The box around the box of a header, turned and in metres from the origin. */
function boxOf({ minimum, maximum, scale }: Header, rotation: readonly number[]): Box {
  const ends = [0, 1, 2].map((row) => {
    const sides = [0, 1, 2].map((k) => [minimum[k], maximum[k]].map((end) => end * scale * rotation[3 * row + k]));
    return [sides.reduce((sum, side) => sum + Math.min(...side), 0), sides.reduce((sum, side) => sum + Math.max(...side), 0)];
  });
  const [[x, right], [y, top], [z, front]] = ends;
  return { minimum: [x, y, z], size: [right - x, top - y, front - z] };
}
