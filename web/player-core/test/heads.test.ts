// Heads of the golden files with fields at the edges of what they may be: the page opens what Python opens, and refuses the rest.

import { expect, test } from "vitest";

import { hasPython, runModule } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";
import { FormatError } from "../src/errors.ts";
import { Head } from "../src/format/reader.ts";

const FILES = ["cut.reel", "splats/splats.reel", ...(ALL ? ["colored/scene.reel", "colored/textures.reel", "scene.reel", "layers.reel", "audio/audio.reel"] : [])];

/** The frames and tracks of a file, or "refused". */
function verdict(data: Uint8Array): string {
  try {
    const { info } = Head.parse(data);
    return `${info.frameCount} ${info.trackCount}`;
  } catch (error) {
    if (error instanceof FormatError) return "refused";
    throw error;
  }
}

test.runIf(hasPython).each(FILES)("heads of %s", (name) => {
  const all = new Uint8Array(runModule("tests.format.heads", name));
  const view = new DataView(all.buffer, all.byteOffset, all.length);
  const differing: string[] = [];
  let count = 0;
  for (let at = 0; at < all.length; count++) {
    const [size, words] = [view.getUint32(at, true), view.getUint32(at + 4, true)];
    const head = all.subarray(at + 8, at + 8 + size);
    const wanted = new TextDecoder().decode(all.subarray(at + 8 + size, (at += 8 + size + words)));
    const found = verdict(head);
    if (found !== wanted) differing.push(`Python: ${wanted}, page: ${found}, head: ${Buffer.from(head).toString("base64")}`);
  }
  expect(count).toBeGreaterThan(1000);
  expect(differing).toEqual([]);
});
