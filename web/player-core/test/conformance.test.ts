// The golden files decode to the same bits as in Python.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";

import { beforeAll, describe, expect, test } from "vitest";

import type { Core } from "../src/wasm/core.ts";
import { Video } from "./whole_video.ts";
import { AudioFile, AudioType } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import { unpackAll } from "../src/format/records.ts";
import type { Mesh } from "./whole_video.ts";
import { ROOT, nodeCore } from "./tools.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".json")).map((name) => name.slice(0, -5));

interface FrameRecord {
  vertices: number;
  faces: number;
  vertices_sha256: string;
  faces_sha256: string;
}
interface Golden {
  frame_rate: number;
  timestamps: number[];
  frames: FrameRecord[];
  frames_with_one_component?: FrameRecord[];
}

function digest(values: Float64Array | Int32Array): string {
  return createHash("sha256").update(new Uint8Array(values.buffer, values.byteOffset, values.byteLength)).digest("hex");
}

function recordOf(mesh: Mesh): FrameRecord {
  return {
    vertices: mesh.vertices.length / 3,
    faces: mesh.faces.length / 3,
    vertices_sha256: digest(mesh.vertices),
    faces_sha256: digest(mesh.faces),
  };
}

let core: Core;
beforeAll(async () => {
  core = await nodeCore();
});

test("the audio of a golden file is what Python wrote", () => {
  const data = new Uint8Array(readFileSync(`${FOLDER}/audio/audio.reel`));
  const { audio } = JSON.parse(readFileSync(`${FOLDER}/audio/audio.json`, "utf8")) as { audio: { start: number; sha256: string } };
  const { info, audio: chunk, header } = Head.parse(data);
  const file = unpackAll(AudioFile, data.subarray(chunk!.offset, chunk!.offset + chunk!.size));
  expect([info.hasAudio, file.type, (file.start - header.firstTime) / 1e6]).toEqual([true, AudioType.OGG, audio.start]);
  expect(createHash("sha256").update(file.data).digest("hex")).toBe(audio.sha256);
});

test("there is a golden file of each form", () => {
  expect(NAMES).toEqual(expect.arrayContaining(["draco", "empty", "laplacian", "layers", "layers_patched", "scene"]));
});

describe.each(NAMES)("%s", (name) => {
  const data = new Uint8Array(readFileSync(`${FOLDER}/${name}.reel`));
  const golden = JSON.parse(readFileSync(`${FOLDER}/${name}.json`, "utf8")) as Golden;

  test("frames have the bits that Python gives", () => {
    const video = new Video(core, data);
    expect(video.head.info.frameCount).toBe(golden.frames.length);
    expect(video.head.info.frameRate).toBe(golden.frame_rate);
    golden.frames.forEach(({ vertices, faces, vertices_sha256, faces_sha256 }, frame) => {
      expect(recordOf(video.frame(frame))).toEqual({ vertices, faces, vertices_sha256, faces_sha256 });
    });
  });

  test("frames are shown at the times that Python says", () => {
    const { head } = new Video(core, data);
    golden.timestamps.forEach((time, frame) => expect(head.timestamp(frame)).toBeCloseTo(time - golden.timestamps[0], 9));
  });

  test.runIf(golden.frames_with_one_component)("a prefix of layers has the bits that Python gives", () => {
    const video = new Video(core, data, 1);
    golden.frames_with_one_component!.forEach(({ vertices, faces, vertices_sha256, faces_sha256 }, frame) => {
      expect(recordOf(video.frame(frame))).toEqual({ vertices, faces, vertices_sha256, faces_sha256 });
    });
  });

  test("played backwards the same", () => {
    const video = new Video(core, data);
    for (let frame = golden.frames.length - 1; frame >= 0; frame--) {
      expect(recordOf(video.frame(frame)).vertices_sha256).toBe(golden.frames[frame].vertices_sha256);
    }
  });
});
