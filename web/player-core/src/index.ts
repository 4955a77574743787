// The public surface of player-core: the player without a picture.

export { FormatError, SourceError, type FormatErrorKind, type SourceErrorKind } from "./errors.ts";
export { importFile, plainOf } from "./net/built.ts";
export { HttpSource, type HttpOptions } from "./net/http_source.ts";
export { Player, type PlayerOptions } from "./player.ts";
export { openWorker, Players, type WorkerFiles } from "./players.ts";
export { WorkerPool, type WorkerLike, type WorkerSetup } from "./time/pool.ts";
export type { DecodeJob, FromWorker, ToWorker } from "./protocol.ts";
export { BlobSource, BytesSource, type Source, type SourceWatch, type Take } from "./net/source.ts";
export type {
  Box, Heard, Info, Layers, Packed, PackedGroup, PackedSplats, PackedStatic, PackedVertices, Playback, PlaybackEvents, Shown, Stats,
} from "./types.ts";
