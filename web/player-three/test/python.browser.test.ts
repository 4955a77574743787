// What the GPU draws of a recording is where Python decodes it: positions read back through the shaders, of two golden files, or of all.

import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { afterAll, beforeAll, expect, test } from "vitest";
import { ChunkDecoder } from "@meshreel/player-core/decode/chunk_decoder";
import { Head } from "@meshreel/player-core/format/reader";
import type { Box, Packed } from "@meshreel/player-core/types";
import { jobOf, noDamage } from "../../player-core/test/jobs.ts";
import { nodeCore } from "../../player-core/test/tools.ts";
import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import { hasPython, ROOT, runPython } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";
import type {} from "./pages/scene.ts";

const FOLDER = join(ROOT, "conformance/v1");
const NAMES = ALL ? readdirSync(FOLDER).filter((name) => name.endsWith(".reel")) : ["layers_patched.reel", "scene.reel"];
const FLOAT32 = 2 ** -22; // of a coordinate: what the shader's own arithmetic may lose

function positionsByPython(name: string, frame: number): Float64Array {
  const bytes = runPython(new URL("positions.py", import.meta.url), join(FOLDER, name), frame);
  return new Float64Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
}

/** How far a position may be off along an axis: one step of the packing, and float32. */
function tolerance({ minimum, size }: Box, k: number): number {
  return size[k] / 65535 + FLOAT32 * Math.max(Math.abs(minimum[k]), Math.abs(minimum[k] + size[k]));
}

describeInBrowser("positions on the GPU and in Python", () => {
  let open: OpenPage;
  beforeAll(async () => {
    open = await openPage(fileURLToPath(new URL("pages/scene.ts", import.meta.url)));
  });
  afterAll(async () => open?.close());

  test.skipIf(!hasPython).each(NAMES)("%s", async (name) => {
    const data = new Uint8Array(readFileSync(join(FOLDER, name)));
    const head = Head.parse(data);
    const decoder = new ChunkDecoder(await nodeCore());
    const packed = head.chunks.map((chunk) => decoder.decode(jobOf(head, chunk, data), noDamage)!);
    for (const frame of new Set([0, head.frameCount >> 1, head.frameCount - 1])) {
      const background = head.staticOfFrame(frame);
      const chunks = [...(background ? [background] : []), ...head.tracks.map((_, track) => head.chunkOfFrame(frame, track))];
      const wanted = positionsByPython(name, frame);
      let at = 0;
      for (const { number } of chunks) {
        const read = await open.page.evaluate(([value, t]) => window.api.readPacked(value, t), [packed[number], frame] as [Packed, number]);
        for (let i = 0; i < read.length; i++, at++) {
          expect(Math.abs(read[i] - wanted[at]), `frame ${frame}, number ${at}`).toBeLessThanOrEqual(tolerance(packed[number].box, i % 3));
        }
      }
      expect(at).toBe(wanted.length);
    }
    expect(open.errors).toEqual([]);
  });
});
