// Packed groups say what the decoder does, within the packing's own steps; and jobs come back in the worker's protocol.

import { readFileSync, readdirSync } from "node:fs";

import { beforeAll, describe, expect, test } from "vitest";

import { ChunkDecoder, MissingState, buffersOf } from "../src/decode/chunk_decoder.ts";
import type { Core } from "../src/wasm/core.ts";
import { Video } from "./whole_video.ts";
import { FormatError } from "../src/errors.ts";
import type { Mesh } from "./whole_video.ts";
import type { FromWorker, ToWorker } from "../src/protocol.ts";
import type { PackedGroup, PackedStatic } from "../src/types.ts";
import { serve } from "../src/decode/worker.ts";
import type { Scope } from "../src/decode/worker.ts";
import { decodeNormal } from "../../test/octahedral.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { ROOT, coreWasm, nodeCore } from "./tools.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".reel"));

let core: Core;
beforeAll(async () => {
  core = await nodeCore();
});

function load(name: string): Uint8Array {
  return new Uint8Array(readFileSync(`${FOLDER}/${name}`));
}

/** The corner positions of a frame's triangles, as a shader would see them: nine numbers each. */
function trianglesOf(packed: PackedGroup | PackedStatic, t: number): number[][] {
  const { texels, box } = packed;
  const at = (texel: number): number[] => [0, 1, 2].map((k) => box.minimum[k] + (box.size[k] * texels[4 * texel + k]) / 65535);
  const shared = packed.kind === "group" ? packed.vertexCount : Infinity;
  const texelOf = (index: number): number => {
    if (packed.kind === "static") return index;
    return index < shared ? t * shared + index : packed.frameCount * shared + (index - shared);
  };
  const extra = packed.kind === "group" ? packed.extra.subarray(packed.extraStarts[t], packed.extraStarts[t + 1]) : new Uint32Array(0);
  const corners = [...packed.faces, ...extra].map((index) => at(texelOf(index)));
  return Array.from({ length: corners.length / 3 }, (_, f) => corners.slice(3 * f, 3 * f + 3).flat());
}

function trianglesOfMesh(mesh: Mesh, origin: readonly number[]): number[][] {
  const corners = [...mesh.faces].map((v) => [0, 1, 2].map((k) => mesh.vertices[3 * v + k] - origin[k]));
  return Array.from({ length: corners.length / 3 }, (_, f) => corners.slice(3 * f, 3 * f + 3).flat());
}

/** The largest distance along an axis from each corner of a triangle to the same one of its nearest triangle. */
function worst(found: number[][], wanted: number[][]): number {
  const away = (a: number[], b: number[]): number => Math.max(...a.map((value, k) => Math.abs(value - b[k])));
  return Math.max(0, ...wanted.map((triangle) => Math.min(...found.map((other) => away(triangle, other)))));
}

describe.each(NAMES)("%s", (name) => {
  test("a frame's triangles are those of the decoder within half a step of the box", () => {
    const data = load(name);
    const video = new Video(core, data);
    const { head } = video;
    const decoder = new ChunkDecoder(core);
    const packed = head.chunks.map((chunk) => decoder.decode(jobOf(head, chunk, data), noDamage)!);
    for (const frame of new Set([0, head.frameCount >> 1, head.frameCount - 1])) {
      const state = head.staticOfFrame(frame);
      const groups = head.tracks.map((_, track) => head.chunkOfFrame(frame, track));
      const shown = [...(state ? [state] : []), ...groups].map((chunk) => [packed[chunk.number], frame - chunk.firstFrame] as const);
      const found = shown.flatMap(([value, t]) => trianglesOf(value, t));
      const wanted = trianglesOfMesh(video.frame(frame), head.header.origin);
      expect(found.length).toBe(wanted.length);
      const step = Math.max(0, ...shown.flatMap(([value]) => value.box.size.map((size) => size / 65535)));
      const rounding = Math.max(...head.header.origin.map(Math.abs)) * 2 ** -50; // of what the decoder gives around its origin
      expect(worst(found, wanted)).toBeLessThanOrEqual(0.5001 * step + rounding);
      expect(worst(wanted, found)).toBeLessThanOrEqual(0.5001 * step + rounding);
    }
  });
});

/** The unit sum of the area-weighted normals of the faces at each vertex; null where there are none. */
function normalsOf(mesh: Mesh): (number[] | null)[] {
  const at = (v: number): number[] => [...mesh.vertices.subarray(3 * v, 3 * v + 3)];
  const sums = Array.from({ length: mesh.vertices.length / 3 }, () => [0, 0, 0]);
  for (let f = 0; f < mesh.faces.length; f += 3) {
    const corners = [...mesh.faces.subarray(f, f + 3)];
    const [a, b, c] = corners.map(at);
    const [u, w] = [b, c].map((end) => end.map((value, k) => value - a[k]));
    const n = [0, 1, 2].map((k) => u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3]);
    for (const v of corners) sums[v] = sums[v].map((value, k) => value + n[k]);
  }
  return sums.map((sum) => (Math.hypot(...sum) > 0 ? sum.map((value) => value / Math.hypot(...sum)) : null));
}

test("normals are those of the frame's own faces, to a degree", () => {
  const data = load("layers_patched.reel");
  const video = new Video(core, data);
  const chunk = video.head.chunks[0];
  const packed = new ChunkDecoder(core).decode(jobOf(video.head, chunk, data), noDamage) as PackedGroup;
  let alone = packed.frameCount * packed.vertexCount;
  for (let t = 0; t < packed.frameCount; t++) {
    normalsOf(video.frame(t)).forEach((normal, v) => {
      const texel = v < packed.vertexCount ? t * packed.vertexCount + v : alone++;
      if (normal === null) return;
      const cosine = decodeNormal(packed.texels[4 * texel + 3]).reduce((sum, value, k) => sum + value * normal[k], 0);
      expect(cosine).toBeGreaterThan(Math.cos(Math.PI / 180));
    });
  }
});

test("a chunk whose predecessor is not at hand asks for the chain", () => {
  const data = load("layers.reel");
  const { head } = new Video(core, data);
  const chunk = head.chunks.find((candidate) => head.groupBefore(candidate) !== null)!;
  expect(() => new ChunkDecoder(core).decode(jobOf(head, chunk, data), noDamage)).toThrow(MissingState);
});

test("a damaged payload is told with chunk and frames, and costs nothing else", () => {
  const data = load("layers.reel");
  const { head } = new Video(core, data);
  const decoder = new ChunkDecoder(core);
  const job = jobOf(head, head.chunks[0], data);
  job.payload[job.payload.length - 1] ^= 1;
  expect(() => decoder.decode(job, noDamage)).toThrow(/chunk 0 \(track 0, frames 0 to \d+\): layer \d+ is damaged/);
  expect(decoder.decode(jobOf(head, head.chunks[0], data), noDamage)).not.toBeNull();
});

test("payloads with any byte changed and their checksums made to fit are refused or decoded, never worse", () => {
  for (const name of NAMES) {
    const data = load(name);
    const { head } = new Video(core, data);
    for (const chunk of head.chunks.filter((candidate) => candidate.dependsOn.length === 0)) {
      for (let at = 1; at < chunk.size; at += 7) {
        const job = jobOf(head, chunk, data);
        job.payload[at] ^= 0x55;
        try {
          new ChunkDecoder(core).decode({ ...job, ranges: [] }, noDamage);
        } catch (error) {
          expect(error, `${name} chunk ${chunk.number} byte ${at}: ${error}`).toBeInstanceOf(FormatError);
        }
      }
    }
  }
});

test("a worker starts, decodes, tells of errors and hands its buffers over", async () => {
  const data = load("layers.reel");
  const { head } = new Video(core, data);
  const told: FromWorker[] = [];
  const handed: Transferable[][] = [];
  const scope: Scope = {
    onmessage: null,
    postMessage: (message, transfer) => {
      told.push(message);
      handed.push(transfer);
    },
  };
  serve(scope);
  const send = (message: ToWorker): void => scope.onmessage!({ data: message } as MessageEvent<ToWorker>);
  send({ type: "start", core: coreWasm() });
  send({ type: "decode", id: 7, job: jobOf(head, head.chunks[0], data) });
  send({ type: "decode", id: 8, job: { ...jobOf(head, head.chunks[0], data), stateOnly: true } });
  send({ type: "decode", id: 9, job: { ...jobOf(head, head.chunks[0], data), form: 3 } });
  send({ type: "forget", file: 1 });
  send({ type: "decode", id: 10, job: { ...jobOf(head, head.chunks[0], data), previous: 5 } });
  await expect.poll(() => told.length).toBe(5);
  expect(told.map(({ type }) => type)).toEqual(["started", "decoded", "decoded", "failed", "failed"]);
  expect(told[1]).toMatchObject({ id: 7, packed: { kind: "group", chunk: 0 } });
  expect(handed[1]).toEqual(buffersOf((told[1] as { packed: PackedGroup }).packed));
  expect(told[2]).toMatchObject({ id: 8, packed: null });
  expect(told[3]).toMatchObject({ id: 9, missingState: false, message: expect.stringContaining("its form is 2") });
  expect(told[4]).toMatchObject({ id: 10, missingState: true });
});
