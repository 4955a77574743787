// Made from src/meshreel/format/layout.py, budget.py and checks.py by scripts/generate. Do not edit.

import {
  array, blob, bytes, choice, f32, f64, i64, list, nested, record, rest, text, u8, u16, u32, varint,
} from "./records.ts";
import type { Kind } from "./records.ts";

export const MAGIC = [82, 69, 69, 76, 13, 10, 26, 10] as const;

export const VERSION = 1;
export const EDITED = 1;
export const MOST_TRACKS = 256;
export const MOST_CHANGES = 255;
export const MOST_NESTED = 100;
export const LARGEST = 1e+15;
export const SMALLEST = 1e-15;

export const LIMITS = {
  free: 201326592,
  perByte: 8192,
  together: 100663296,
  chain: 8,
  head: 67108864,
  frames: 65535,
  framesPerByte: 64,
  frame: 1024,
  element: 160,
  shown: 30,
  moving: 30,
  solved: 1600,
  column: 20,
  pair: 100,
  number: 40,
  colors: 100663296,
  painted: 32,
  painting: 256,
  pictures: 805306368,
  texel: 2,
  videos: 184549376,
  splat: 1024,
  audio: 268435456,
  faces: 64000000,
  numbers: 536870912,
  held: 44,
} as const;

export const ChunkKind = {
  STATIC: 1,
  GROUP: 2,
  COLORS: 3,
  ATLAS: 4,
  PICTURES: 5,
  COMPATIBLE: 6,
  SPLATS: 7,
  AUDIO: 8,
} as const;

export const Form = {
  LAPLACIAN: 1,
  LAYERS: 2,
  DRACO: 3,
  EMPTY: 4,
  PATCH: 5,
  VERTEX_COLORS: 6,
  PLACES: 7,
  VIDEO: 8,
  GAUSSIANS: 9,
  AUDIO_FILE: 10,
} as const;

export const AnchorRule = {
  SPREAD: 1,
  FARTHEST: 2,
} as const;

export const Origin = {
  ALONE: 0,
  PREVIOUS: 1,
} as const;

export const SharedMotion = {
  NONE: 0,
  SHIFTS: 1,
  POSES: 2,
} as const;

export const VideoCodec = {
  AV1: 1,
  H264: 2,
} as const;

export const AudioType = {
  OGG: 1,
  WEBM: 2,
  MP4: 3,
  ADTS: 4,
  MPEG: 5,
} as const;

/** The first bytes of a file: its signature, and the size of the head. */
export interface Preamble {
  readonly magic: Uint8Array; // `52 45 45 4c 0d 0a 1a 0a`
  readonly version: number; // version of the format, 1; a reader refuses any other
  readonly flags: number; // 1: the metadata has an `edit`, which counts; other bits are 0
  readonly headSize: number; // size of the head, bytes: offset of the first chunk
}
export const Preamble: Kind<Preamble> = record("Preamble", {
  magic: bytes(8),
  version: u8,
  flags: u8,
  headSize: u32,
});

/** Values for all frames. Coordinates y in chunks are normalised: x = origin + scale * y is in metres. */
export interface Header {
  readonly frameRate: number; // 1/s, above 0
  readonly origin: readonly number[]; // m
  readonly scale: number; // m, above 0
  readonly minimum: readonly number[]; // lower corner of the sequence's bounding box, normalised
  readonly maximum: readonly number[]; // upper corner of this box
  readonly metadata: string; // a JSON object, not needed for decoding: `up` (axis; y if absent), preset ...
  readonly firstTime: number; // time of frame 0, microseconds
  readonly intervals: readonly number[]; // microseconds from each frame to the next, each above 0; if empty, frame i is at first_time + 10^6 * i / frame_rate
}
export const Header: Kind<Header> = record("Header", {
  frameRate: f64,
  origin: array(3, f64),
  scale: f64,
  minimum: array(3, f32),
  maximum: array(3, f32),
  metadata: text(u16),
  firstTime: i64,
  intervals: list(varint, varint),
});

/** Byte range of a chunk, whose first k layers are its first bytes; the form decides which k can be decoded. */
export interface Layer {
  readonly size: number; // bytes, above 0
  readonly crc: number; // CRC-32 (ISO-HDLC, as in zlib) of these bytes
}
export const Layer: Kind<Layer> = record("Layer", {
  size: varint,
  crc: u32,
});

/** Index entry of a chunk. */
export interface IndexEntry {
  readonly kind: number; // purpose
  readonly form: number; // coding; equal to the first byte of the chunk
  readonly frames: number; // number of frames; 0 if and only if STATIC, a companion of one, or AUDIO
  readonly track: number; // number of the moving body, from 0; 0 if STATIC or AUDIO
  readonly dependsOn: readonly number[]; // numbers of the earlier chunks that it needs: for a GROUP, the STATIC chunk it is shown with and the GROUP right before it in its track; for a STATIC of form PATCH, the STATIC chunk that it changes; for COLORS, the chunk whose vertices have them and, where they are predicted, the COLORS of the group before; for ATLAS, the GROUP whose base mesh, or the STATIC whose faces, it places; for SPLATS, the GROUP whose base mesh they are on; for PICTURES and COMPATIBLE, the GROUP, the ATLAS, and but for the first of this, that of the group before
  readonly layers: readonly Layer[]; // at least one
}
export const IndexEntry: Kind<IndexEntry> = record("IndexEntry", {
  kind: u8,
  form: u8,
  frames: u16,
  track: varint,
  dependsOn: list(u8, varint),
  layers: list(u16, nested(() => Layer)),
});

/** All chunks in the order of their bytes; in each track the frames of GROUP chunks follow one another from 0. */
export interface Index {
  readonly chunks: readonly IndexEntry[]; // chunk 0, 1 ...
}
export const Index: Kind<Index> = record("Index", {
  chunks: list(u32, nested(() => IndexEntry)),
});

/** Last record of the head: its checksum. */
export interface Checksum {
  readonly crc: number; // CRC-32 of the head up to here
}
export const Checksum: Kind<Checksum> = record("Checksum", {
  crc: u32,
});

/** The payload of a group of form LAPLACIAN. */
export interface LaplacianGroup {
  readonly form: number; // LAPLACIAN
  readonly levels: number; // midpoint subdivisions of the decoded reference mesh
  readonly step: number; // spacing of the reference's lattice, above 0: decoded vertices are rounded to multiples
  readonly reference: Uint8Array; // the reference mesh, Draco
  readonly displacements: Uint8Array; // a DisplacementHead and its streams
}
export const LaplacianGroup: Kind<LaplacianGroup> = record("LaplacianGroup", {
  form: choice(u8, Form),
  levels: u8,
  step: f64,
  reference: blob(u32),
  displacements: rest,
});

/** Direction of the basis, and sizes of the streams of its weights. */
export interface Component {
  readonly basisBits: number; // b, at most 30: the direction's numbers are integers times 2^-b
  readonly stepLevel: number; // k: the quantiser's step is 2^(-k/8)
  readonly anchorsSize: number; // bytes of its anchors' stream
  readonly deltasSize: number; // bytes of its deltas' stream
}
export const Component: Kind<Component> = record("Component", {
  basisBits: u8,
  stepLevel: u8,
  anchorsSize: varint,
  deltasSize: varint,
});

/** Head of coded displacements; for each component in turn, the streams of its anchors and its deltas follow. */
export interface DisplacementHead {
  readonly frames: number; // T, above 0
  readonly anchorRule: number; // how anchors are chosen
  readonly anchorCount: number; // number of requested anchors; each connected component has at least one
  readonly anchorWeight: number; // factor of the anchors' rows, above 0
  readonly meanBits: number; // b, at most 30: the mean's numbers are integers times 2^-b
  readonly components: readonly Component[]; // strongest first, at most 3 T
  readonly basis: Uint8Array; // integers: 3 T of the mean, then 3 T of each component's direction
}
export const DisplacementHead: Kind<DisplacementHead> = record("DisplacementHead", {
  frames: u16,
  anchorRule: choice(u8, AnchorRule),
  anchorCount: varint,
  anchorWeight: u8,
  meanBits: u8,
  components: list(u16, nested(() => Component)),
  basis: blob(varint),
});

/** Trajectories in a basis: quantised weights at the vertices of a causal graph. */
export interface CodedField {
  readonly columns: number; // M, number of basis vectors
  readonly stepLevel: number; // k: the quantiser's step is 2^(-k/8)
  readonly basis: Uint8Array; // integers: what moves all vertices alike, if anything, then the basis
  readonly symbols: Uint8Array; // one stream: the symbols of all columns
}
export const CodedField: Kind<CodedField> = record("CodedField", {
  columns: varint,
  stepLevel: u8,
  basis: blob(varint),
  symbols: blob(varint),
});

/** First layer of a group of form LAYERS; a LayersLevel for each level follows. */
export interface LayersGroup {
  readonly form: number; // LAYERS
  readonly origin: number; // source of the base mesh
  readonly frames: number; // T, above 0
  readonly levels: number; // L, midpoint subdivisions of the base mesh
  readonly step: number; // spacing of the base's lattice, above 0: decoded vertices are rounded to multiples
  readonly base: Uint8Array; // the base mesh, Draco; no bytes where its origin is PREVIOUS
  readonly shared: number; // what moves all vertices alike
  readonly motion: CodedField; // the displacements of the base's vertices
}
export const LayersGroup: Kind<LayersGroup> = record("LayersGroup", {
  form: choice(u8, Form),
  origin: choice(u8, Origin),
  frames: u8,
  levels: u8,
  step: f64,
  base: blob(varint),
  shared: choice(u8, SharedMotion),
  motion: nested(() => CodedField),
});

/** Layer of a group of form LAYERS that refines it by one level of subdivision. */
export interface LayersLevel {
  readonly origin: number; // prediction of the scalars
  readonly curvature: number; // share of an edge's sagitta by which its midpoint is lifted, 64ths
  readonly siblingWeight: number; // weight of the siblings' mean in a prediction, 64ths
  readonly scalars: CodedField; // the offsets of its new vertices
}
export const LayersLevel: Kind<LayersLevel> = record("LayersLevel", {
  origin: choice(u8, Origin),
  curvature: u8,
  siblingWeight: u8,
  scalars: nested(() => CodedField),
});

/** Optional last layer of a group of form LAYERS: corrections where frames do not follow the base mesh. */
export interface LayersPatches {
  readonly runs: number; // number of integers in `dropped`
  readonly dropped: Uint8Array; // integers: lengths of runs; they mark the faces that each frame lacks
  readonly stepLevel: number; // k: the spacing of the mesh's lattice is 2^(-k/8)
  readonly width: number; // cells along x that each frame has in the lattice
  readonly mesh: Uint8Array; // additional faces of all frames, Draco; no bytes: nothing
}
export const LayersPatches: Kind<LayersPatches> = record("LayersPatches", {
  runs: varint,
  dropped: blob(varint),
  stepLevel: u8,
  width: varint,
  mesh: blob(varint),
});

/** The payload of a group of form DRACO. */
export interface DracoGroup {
  readonly form: number; // DRACO
  readonly levels: number; // midpoint subdivisions of every decoded mesh
  readonly step: number; // spacing of the frames' lattice, above 0: decoded vertices are rounded to multiples
  readonly meshes: readonly Uint8Array[]; // one Draco mesh per frame; no bytes: an empty frame
}
export const DracoGroup: Kind<DracoGroup> = record("DracoGroup", {
  form: choice(u8, Form),
  levels: u8,
  step: f64,
  meshes: list(u16, blob(u32)),
});

/** The payload of a group of form EMPTY. */
export interface EmptyGroup {
  readonly form: number; // EMPTY
}
export const EmptyGroup: Kind<EmptyGroup> = record("EmptyGroup", {
  form: choice(u8, Form),
});

/** The payload of a STATIC chunk of form PATCH: changes of the background that it depends on. */
export interface StaticPatch {
  readonly form: number; // PATCH
  readonly step: number; // spacing of the mesh's lattice, above 0: decoded vertices are rounded to multiples
  readonly runs: number; // number of integers in `dropped`
  readonly dropped: Uint8Array; // integers: lengths of runs of faces, kept and dropped in turn
  readonly mesh: Uint8Array; // additional faces, Draco; no bytes: nothing
}
export const StaticPatch: Kind<StaticPatch> = record("StaticPatch", {
  form: choice(u8, Form),
  step: f64,
  runs: varint,
  dropped: blob(varint),
  mesh: blob(varint),
});

/** First bytes of a chunk of form VERTEX_COLORS; for each mesh, a CodedField and a ColorsLevel a level follow. */
export interface VertexColors {
  readonly form: number; // VERTEX_COLORS
  readonly origin: number; // prediction of the values
  readonly chroma: number; // what colour differences were multiplied by, 64ths, above 0
}
export const VertexColors: Kind<VertexColors> = record("VertexColors", {
  form: choice(u8, Form),
  origin: choice(u8, Origin),
  chroma: u8,
});

/** Colours of the vertices that a level of subdivision adds. */
export interface ColorsLevel {
  readonly siblingWeight: number; // weight of the siblings' mean in a prediction, 64ths
  readonly values: CodedField; // differences from the means of the ends of their edges
}
export const ColorsLevel: Kind<ColorsLevel> = record("ColorsLevel", {
  siblingWeight: u8,
  values: nested(() => CodedField),
});

/** The payload of a chunk of form PLACES: of each corner of the base mesh's faces, its place in the texture. */
export interface Atlas {
  readonly form: number; // PLACES
  readonly width: number; // of the texture, texels, even, above 0
  readonly height: number; // of the texture, texels, even, above 0
  readonly joinCount: number; // number of integers in `joins`
  readonly startCount: number; // number of integers in `starts`
  readonly restCount: number; // number of integers in `rests`
  readonly joins: Uint8Array; // integers: whether faces share the places of an edge, or of a corner
  readonly starts: Uint8Array; // integers: places of the faces that share none with one before
  readonly rests: Uint8Array; // integers: differences of places from where shapes predict them
}
export const Atlas: Kind<Atlas> = record("Atlas", {
  form: choice(u8, Form),
  width: u16,
  height: u16,
  joinCount: varint,
  startCount: varint,
  restCount: varint,
  joins: blob(varint),
  starts: blob(varint),
  rests: blob(varint),
});

/** The payload of a chunk of form VIDEO: the textures of a group's frames; of a background, each of its layers. */
export interface Pictures {
  readonly form: number; // VIDEO
  readonly codec: number; // coding of the pictures
  readonly interval: number; // frames from one picture to the next, above 0; 1 of a GROUP
  readonly packets: readonly Uint8Array[]; // one a picture, in their order
}
export const Pictures: Kind<Pictures> = record("Pictures", {
  form: choice(u8, Form),
  codec: choice(u8, VideoCodec),
  interval: varint,
  packets: list(u16, blob(varint)),
});

/** First bytes of a chunk of form GAUSSIANS; a GaussiansLayer follows for each of its layers. */
export interface Gaussians {
  readonly form: number; // GAUSSIANS
  readonly placeBits: number; // b, 1 to 14: weights of a face's corners are integers times 2^-b
  readonly turnBits: number; // b, 1 to 14: angles are integers times pi 2^-b
  readonly opacityBits: number; // b, 1 to 14: opacities are integers times 2^-b
  readonly colorBits: number; // b, 1 to 14: lumas and colour differences are integers times 2^-b
  readonly offsetLevel: number; // k: offsets along the normal are integers times 2^(-k/8)
  readonly scaleLevel: number; // k, which levels of scales are counted from
  readonly count: number; // N, splats of all layers
}
export const Gaussians: Kind<Gaussians> = record("Gaussians", {
  form: choice(u8, Form),
  placeBits: u8,
  turnBits: u8,
  opacityBits: u8,
  colorBits: u8,
  offsetLevel: u8,
  scaleLevel: u8,
  count: varint,
});

/** Splats of a layer, in the order of their faces. */
export interface GaussiansLayer {
  readonly count: number; // n, above 0
  readonly faces: Uint8Array; // n integers: how many faces of the base mesh lie between it and the last
  readonly places: Uint8Array; // 2 n integers: weights of the second corners, then of the third ones
  readonly offsets: Uint8Array; // n integers: offsets along the normal
  readonly turns: Uint8Array; // n integers: angles of the longer axes
  readonly scales: Uint8Array; // 2 n integers: levels of longer scales, then how many the shorter add
  readonly opacities: Uint8Array; // n integers: opacities
  readonly colors: Uint8Array; // 3 n integers: lumas, then both differences, each less the splat before
}
export const GaussiansLayer: Kind<GaussiansLayer> = record("GaussiansLayer", {
  count: varint,
  faces: blob(varint),
  places: blob(varint),
  offsets: blob(varint),
  turns: blob(varint),
  scales: blob(varint),
  opacities: blob(varint),
  colors: blob(varint),
});

/** The payload of a chunk of form AUDIO_FILE; its layers are pieces of it. */
export interface AudioFile {
  readonly form: number; // AUDIO_FILE
  readonly type: number; // what the file is
  readonly start: number; // when it begins, microseconds of the clock that first_time is of
  readonly data: Uint8Array; // the file, at least one byte
}
export const AudioFile: Kind<AudioFile> = record("AudioFile", {
  form: choice(u8, Form),
  type: choice(u8, AudioType),
  start: i64,
  data: rest,
});
