// The jobs that a player sends to its workers for the chunks of a file that is wholly there.

import type { Companion, Damage, DecodeJob } from "../src/protocol.ts";
import { isVideo } from "../src/format/reader.ts";
import type { Chunk, Head } from "../src/format/reader.ts";

/** The job that decodes a chunk with all its layers, its payload a copy. */
export function jobOf(head: Head, chunk: Chunk, data: Uint8Array): DecodeJob {
  const before = chunk.kind === "static" ? head.changedFrom(chunk) : head.groupBefore(chunk);
  const { number, form, track, firstFrame, frameCount } = chunk;
  const kind = chunk.kind as DecodeJob["kind"];
  const others = head.companionsOf(chunk);
  const companions = others.filter((other) => !isVideo(other)).map((other): Companion => ({ chunk: other.number, kind: other.kind, form: other.form, ...bytesOf(other, data) }));
  const previous = before?.number ?? null;
  const whole = { layers: null, previous, scale: head.header.scale, stateOnly: false, textured: companions.length < others.length };
  return { file: 1, chunk: number, kind, form, track, firstFrame, frameCount, ...bytesOf(chunk, data), companions, ...whole };
}

function bytesOf({ offset, size, layers }: Chunk, data: Uint8Array): Pick<DecodeJob, "payload" | "ranges"> {
  return { payload: data.slice(offset, offset + size), ranges: layers.map((layer) => ({ size: layer.size, crc: layer.crc })) };
}

/** What a decoder is given that must find no damage. */
export function noDamage({ message }: Damage): void {
  throw new Error(message);
}
