// Reading the head of a file, in one request where it is short.

import { joined } from "../bytes.ts";
import { decodable } from "../format/renditions.ts";
import { FormatError } from "../errors.ts";
import { FIRST_REQUEST, Head } from "../format/reader.ts";
import type { Rendition } from "../types.ts";
import type { Source } from "./source.ts";

const MOST_HEAD = 1 << 26; // bytes; ten hours of groups have a tenth of that

export interface Opened {
  readonly head: Head;
  readonly first: Uint8Array; // the bytes that came with it, from the file's first on
  readonly decodable: readonly Rendition[] | null; // of its textures: what this browser decodes; null where it has no WebCodecs, or they are none
}

/** The head of the file in a source. FormatError where it is none, SourceError where it cannot be read. */
export async function open(source: Source, signal: AbortSignal): Promise<Opened> {
  const pieces: Uint8Array[] = [];
  const read = (offset: number, length: number): Promise<void> => source.read(offset, length, (bytes) => pieces.push(bytes), signal);
  await read(0, FIRST_REQUEST);
  let first = joined(pieces);
  const size = Head.sizeOf(first);
  if (size > first.length && size <= Math.min(MOST_HEAD, source.size ?? MOST_HEAD)) await read(first.length, size - first.length);
  first = joined(pieces);
  if (first.length < size) throw new FormatError(`a head of ${size} bytes in a file of ${source.size ?? first.length}: truncated or damaged`);
  const head = Head.parse(first);
  if (source.size !== null && source.size > head.size) {
    throw new FormatError(`${source.size - head.size} bytes behind the last chunk, copy the file again`);
  }
  source.expect(head.size);
  const found = head.info.hasTextures ? await decodable() : null;
  signal.throwIfAborted();
  return { head, first, decodable: found };
}
