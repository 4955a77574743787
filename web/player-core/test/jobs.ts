// The jobs that a player sends to its workers for the chunks of a file that is wholly there.

import type { DecodeJob } from "../src/protocol.ts";
import type { Chunk, Head } from "../src/format/reader.ts";

/** The job that decodes a chunk with all its layers, its payload a copy. */
export function jobOf(head: Head, chunk: Chunk, data: Uint8Array): DecodeJob {
  const before = chunk.kind === "static" ? head.changedFrom(chunk) : head.groupBefore(chunk);
  const { number, kind, form, track, firstFrame, frameCount } = chunk;
  const payload = data.slice(chunk.offset, chunk.offset + chunk.size);
  const ranges = chunk.layers.map(({ size, crc }) => ({ size, crc }));
  const previous = before?.number ?? null;
  const whole = { layers: null, previous, scale: head.header.scale, stateOnly: false };
  return { file: 1, chunk: number, kind, form, track, firstFrame, frameCount, payload, ranges, ...whole };
}
