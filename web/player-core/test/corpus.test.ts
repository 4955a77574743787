// The corpus of the fuzzers: the player refuses what Python refuses, and decodes the rest to the same bits.

import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";

import { beforeAll, expect, test } from "vitest";

import { slowTest } from "../../test/slow.ts";
import { Video } from "./whole_video.ts";
import type { Core } from "../src/wasm/core.ts";
import { FormatError } from "../src/errors.ts";
import { Head } from "../src/format/reader.ts";
import type { Mesh } from "./whole_video.ts";
import { open } from "../src/net/opening.ts";
import { BytesSource } from "../src/net/source.ts";
import { group, makeReel } from "./reel.ts";
import { ROOT, nodeCore } from "./tools.ts";

const FOLDER = `${ROOT}/core/fuzz/corpus`;
const MOST_FRAMES = 24; // as in core/fuzz/verdict.py
const VERDICTS = JSON.parse(readFileSync(`${FOLDER}/verdicts.json`, "utf8")) as Record<string, [string, string]>;

let core: Core;
beforeAll(async () => {
  core = await nodeCore();
});

/** Null where the bytes are refused. */
function refused(error: unknown): null {
  if (error instanceof FormatError) return null;
  throw error;
}

/** As `verdict` of core/fuzz/verdict.py. */
async function verdict(data: Uint8Array, layers: number | null): Promise<string> {
  const opened = await open(new BytesSource(data), new AbortController().signal).catch(refused);
  if (opened === null) return "refused";
  const video = new Video(core, data, layers);
  const total = createHash("sha256");
  let shown = 0;
  for (let frame = 0; frame < Math.min(video.head.info.frameCount, MOST_FRAMES); frame++) {
    const mesh = frameOf(video, frame);
    if (mesh === null) {
      total.update("refused");
      continue;
    }
    shown += 1;
    for (const { buffer, byteOffset, byteLength } of [mesh.vertices, mesh.faces]) total.update(new Uint8Array(buffer, byteOffset, byteLength));
  }
  return `${shown} ${total.digest("hex").slice(0, 16)}`;
}

function frameOf(video: Video, frame: number): Mesh | null {
  try {
    return video.frame(frame);
  } catch (error) {
    return refused(error);
  }
}

slowTest.each(Object.entries(VERDICTS))("%s", async (name, wanted) => {
  const data = new Uint8Array(readFileSync(`${FOLDER}/${name}`));
  expect([await verdict(data, null), await verdict(data, 1)]).toEqual(wanted);
});

test.each(["", "[]", "null", '{"a":NaN}', '{"a":1e999}', '{"a":"\\ud800"}', '{"\\udc00":1}'])("metadata %s is refused, as in Python", (text) => {
  expect(() => Head.parse(makeReel([group(1, [10])], { frameRate: 25, metadata: text }))).toThrow(/^Header\.metadata: not/);
});

test("metadata may name anything", () => {
  expect(Head.parse(makeReel([group(1, [10])], { frameRate: 25, metadata: '{"toString":1,"a":"\\ud83d\\ude00"}' })).info.metadata).toEqual({ toString: 1, a: "😀" });
});
