// The most expensive legal files, as tests/budget builds them: the player decodes each within a bound on its memory, and refuses more.

import { describe, expect, test, vi } from "vitest";

import { hasPython, runPython } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";
import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import { Head } from "../src/format/reader.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { Video } from "./whole_video.ts";
import { FormatError } from "../src/errors.ts";
import { checkFrames, checkPictures, together } from "../src/format/budget.ts";
import { Form, LIMITS } from "../src/format/layout.gen.ts";
import { group, makeReel } from "./reel.ts";
import { pass, useRig } from "./rig.ts";
import { nodeCore } from "./tools.ts";

const NAMES = ["draco", "frames of draco", "layers", "predicted layers", "laplacian", "laplacian of many frames", "laplacian of a fan", "patches of a background"];
const SCRIPT = new URL("./worst_file.py", import.meta.url);

test.runIf(ALL && hasPython).each(NAMES)("the worst legal file of %s is decoded, within the memory that FORMAT.md allows", async (name) => {
  const core = await nodeCore();
  const data = new Uint8Array(runPython(SCRIPT, name));
  const [head, decoder] = [Head.parse(data), new ChunkDecoder(core)];
  const packed = head.chunks.map((chunk) => decoder.decode(jobOf(head, chunk, data), noDamage)!);
  expect(packed.at(-1)!.texels.length).toBeGreaterThan(0);
  const most = 384 * 2 ** 20 + 16384 * data.length;
  expect(core.size).toBeLessThan(most);
});

test("what costs more than its bytes may is refused", () => {
  checkFrames(LIMITS.frames, 0);
  expect(() => checkFrames(LIMITS.frames + 1, 0)).toThrow(FormatError);
  const texels = LIMITS.pictures / LIMITS.texel;
  checkPictures(texels, 0);
  expect(() => checkPictures(texels + 1, 0)).toThrow(/pictures: 0 bytes that cost 80530/);
  checkPictures(texels + 1, 1);
  expect(together(10) - together(0)).toBe(10 * LIMITS.perByte);
});

test("a chunk that is refused is decoded once, whatever frames are asked for", async () => {
  const video = new Video(await nodeCore(), makeReel([group(5, [40], { form: Form.LAYERS })], { frameRate: 25 }));
  const begun = vi.spyOn(video.head, "groupBefore");
  for (const frame of [0, 1, 2, 3, 4, 0]) expect(() => video.frame(frame)).toThrow(FormatError);
  expect(begun).toHaveBeenCalledTimes(1);
});

describe("a group that takes too much memory with those of other tracks", () => {
  const rig = useRig();

  test("is skipped", async () => {
    rig.workers.bytesPerFrame = 60e6;
    rig.begin(makeReel([group(1, [10]), group(1, [10], { track: 1 })], { frameRate: 25 }), 1e6);
    await Promise.all([rig.player.load(), pass(1)]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/with those of other tracks it takes 1200000\d\d bytes, over 100827136; it is skipped$/)]);
    expect(rig.player.stats.skippedGroups).toBe(1);
  });
});
