// Messages between the player and its decoding workers.

import type { CompanionKind, Packed } from "./types.ts";

export type ToWorker =
  | { type: "start"; core: ArrayBuffer | string } // wasm bytes, or their URL
  | { type: "decode"; id: number; job: DecodeJob }
  | { type: "forget"; file: number };

/** One chunk to decode. */
export interface DecodeJob {
  file: number;
  chunk: number;
  kind: "group" | "static";
  form: number;
  track: number;
  firstFrame: number;
  frameCount: number;
  payload: Uint8Array; // its buffer is transferred
  ranges: { size: number; crc: number }[]; // of the layers in `payload`
  companions: Companion[]; // pictures are not among them: they are decoded elsewhere
  textured: boolean; // true if pictures of it will be shown
  layers: number | null; // layers beyond the first; null: all
  previous: number | null; // chunk whose state it needs, decoded earlier in this worker; or the static chunk that a patch changes
  scale: number;
  stateOnly: boolean; // decode for the chain's sake, pack nothing
}

/** Companions with which a job's chunk is decoded. */
export interface Companion {
  chunk: number;
  kind: CompanionKind;
  form: number;
  payload: Uint8Array; // its buffer is transferred
  ranges: { size: number; crc: number }[];
}

/** A companion that cannot be decoded; its chunk was decoded without it. */
export interface Damage {
  chunk: number; // the companion's
  message: string;
}

export type FromWorker =
  | { type: "started" }
  | { type: "decoded"; id: number; packed: Packed | null; damage: Damage[]; ms: number } // null for stateOnly
  | { type: "failed"; id: number; message: string; damage: Damage[]; missingState: boolean }; // the state was evicted: send the chain again
