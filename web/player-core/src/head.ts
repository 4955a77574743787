// The head as the player takes it.

import type { Info } from "./types.ts";

export interface Chunk {
  readonly number: number;
  readonly kind: "static" | "group";
  readonly form: number;
  readonly firstFrame: number;
  readonly frameCount: number;
  readonly dependsOn: readonly number[];
  readonly offset: number;
  readonly size: number;
  readonly layers: readonly { size: number; crc: number }[];
  readonly track: number;
}

export interface Head {
  readonly info: Info;
  readonly header: { readonly scale: number };
  readonly chunks: readonly Chunk[];
  readonly tracks: readonly (readonly Chunk[])[];
  timestamp(frame: number): number;
  chunkOfFrame(frame: number, track: number): Chunk;
  staticOfFrame(frame: number): Chunk | null;
  groupBefore(chunk: Chunk): Chunk | null;
  changedFrom(chunk: Chunk): Chunk | null;
}
