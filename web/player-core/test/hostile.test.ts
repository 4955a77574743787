// Chunks whose checksums are right and whose content is not: refused in words or decoded, and nothing of them stays behind.

import { readFileSync, readdirSync } from "node:fs";

import { beforeAll, describe, expect, test } from "vitest";

import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import type { Core } from "../src/wasm/core.ts";
import { crc32 } from "../src/format/crc.ts";
import { FormatError } from "../src/errors.ts";
import { Links } from "../src/format/links.ts";
import type { DecodeJob } from "../src/protocol.ts";
import { Head } from "../src/format/reader.ts";
import type { Chunk } from "../src/format/reader.ts";
import { CoreStopped } from "../src/wasm/core.ts";
import { noDamage } from "./jobs.ts";
import { noise } from "./server.ts";
import { ROOT, nodeCore } from "./tools.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".reel"));
const TRIES = 40; // of each chunk
const VALUES = [0, 1, 0x7f, 0x80, 0xff];

let core: Core;
beforeAll(async () => {
  core = await nodeCore();
});

function jobOf(chunk: Chunk, payload: Uint8Array, previous: Chunk | null): DecodeJob {
  const { number, form, track, firstFrame, frameCount } = chunk;
  const kind = chunk.kind as DecodeJob["kind"];
  let at = 0;
  const ranges = chunk.layers.map(({ size }) => ({ size, crc: crc32(payload.subarray(at, (at += size))) }));
  const place = { kind, form, track, firstFrame, frameCount } as const;
  return { file: 1, chunk: number, ...place, payload, ranges, companions: [], layers: null, previous: previous?.number ?? null, scale: 1, stateOnly: false, textured: false };
}

/** With one to four bytes changed, most of them near the start, where sizes and counts are; never the form. */
function spoiled(payload: Uint8Array, seed: number): Uint8Array {
  const copy = payload.slice();
  const random = noise(17, seed);
  for (let k = 0; k < 1 + (random[0]! & 3); k++) {
    const [where, high, low, value] = random.subarray(1 + 4 * k, 5 + 4 * k);
    const range = where! < 160 ? Math.min(60, copy.length) : copy.length;
    const place = 1 + (((high! << 8) | low!) % Math.max(1, range - 1));
    if (place < copy.length) copy[place] = VALUES[value! % 6] ?? value! ^ copy[place]!;
  }
  return copy;
}

describe.each(NAMES)("%s", (name) => {
  const data = new Uint8Array(readFileSync(`${FOLDER}/${name}`));
  const head = Head.parse(data);
  const links = new Links(head);

  test("with content that is changed is refused in words or decoded, and decodes as before behind it", () => {
    const payloadOf = ({ offset, size }: Chunk): Uint8Array => data.slice(offset, offset + size);
    const decode = (decoder: ChunkDecoder, chunk: Chunk, payload = payloadOf(chunk)): unknown => {
      const packed = decoder.decode(jobOf(chunk, payload, links.previousOf(chunk)), noDamage);
      return packed && { ...packed, decodeMs: 0 };
    };
    const sound = new ChunkDecoder(core);
    const made = head.chunks.map((chunk) => decode(sound, chunk));
    for (const chunk of head.chunks) {
      for (let seed = 1; seed <= TRIES; seed++) {
        try {
          decode(sound, chunk, spoiled(payloadOf(chunk), 1000 * chunk.number + seed));
        } catch (error) {
          expect(error).toBeInstanceOf(FormatError);
          expect((error as Error).message).toMatch(/^[^\n]+$/);
        }
      }
      expect(decode(sound, chunk)).toEqual(made[chunk.number]);
    }
  });
});

test("where there is no memory the decoder stops", async () => {
  const data = new Uint8Array(readFileSync(`${FOLDER}/draco.reel`));
  const chunk = Head.parse(data).chunks[0]!;
  const payload = data.slice(chunk.offset, chunk.offset + chunk.size);
  const full = await nodeCore();
  Object.assign(full, { calls: { ...(full as unknown as { calls: object }).calls, mr_allocate: () => 0 } });
  expect(() => new ChunkDecoder(full).decode(jobOf(chunk, payload, null), noDamage)).toThrow(CoreStopped);
});
