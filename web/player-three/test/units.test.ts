import { Vector3 } from "three";
import { describe, expect, test } from "vitest";
import { SPLAT_WEIGHT, SPLAT_WORDS } from "@meshreel/player-core/types";
import { trackColor } from "../src/colors.ts";
import type { Vector } from "../src/colors.ts";
import type { Info, Shown } from "@meshreel/player-core/types";
import { updateFar } from "../src/far.ts";
import { orderSplats } from "../src/order.ts";
import type { OrderJob } from "../src/order.ts";
import { localFrame, triangleCount, vertexRoom } from "../src/ranges.ts";
import { surfaceVertex, SURFACE_FRAGMENT } from "../src/shaders.ts";
import { Sorter } from "../src/sorter.ts";
import { lying, standing } from "../src/standing.ts";
import type { OrderWorker } from "../src/sorter.ts";
import { Upload } from "../src/upload.ts";
import { makeFloor, makeGroup } from "./analytic.ts";

test("a first view stands up with its recording, and a place in the scene has one in the file", () => {
  const view = { position: [1, -3, 0.5], target: [1, 0, 0.5], fov: 30 } as const; // of a file in which z points up
  const info = { metadata: { up: "z" }, box: { minimum: [0, 0, 0], size: [1, 2, 3] }, origin: [10, 20, 30], view } as unknown as Info;
  const stood = standing(info, null).view!;
  stood.position.forEach((value, k) => expect(value).toBeCloseTo([1, 0.5, 3][k]));
  stood.target.forEach((value, k) => expect(value).toBeCloseTo([1, 0.5, 0][k]));
  lying(new Vector3(...stood.position), info, null).toArray().forEach((value, k) => expect(value).toBeCloseTo([11, 17, 30.5][k]));
  expect(standing(info, "z").view?.fov).toBe(30);
  expect(standing(info, "y").view).toBeNull(); // it would look from above
});

test("a frame shows the group's triangles and its own, and a frame beside the group its nearest", () => {
  const { packed } = makeGroup({ firstFrame: 10 });
  const sphereTriangles = packed.faces.length / 3;
  expect([9, 10, 11, 12, 13, 14].map((frame) => localFrame(packed, frame))).toEqual([0, 0, 1, 2, 3, 3]);
  expect([10, 11, 12, 13].map((frame) => triangleCount(packed, frame) - sphereTriangles)).toEqual([0, 0, 2, 0]);
  expect(triangleCount(makeFloor(3).packed, 5)).toBe(18);
});

test("normals, colours and places are those of the covered part of a pixel, so that none is extrapolated at outlines", () => {
  for (const name of ["vec3 sceneNormal", "vec3 ownColor", "vec2 texturePlace"]) {
    expect(surfaceVertex("texture")).toContain(`centroid out ${name};`);
    expect(SURFACE_FRAGMENT).toContain(`centroid in ${name};`);
  }
});

test("a body is far where it is small, and near again where it is somewhat larger", () => {
  const { packed } = makeGroup({ track: 1 });
  const shown: Shown = { frame: 0, blend: 0, frames: [0, 0], groups: [null, packed], background: null, images: [null, null], backgroundImage: null };
  const across = Math.hypot(...packed.box.size);
  const far = new Set<number>();
  const states = [100, 80, 50, 80, 100].map((pixels) => {
    const [x, y, z] = packed.box.minimum.map((low, k) => low + packed.box.size[k] / 2);
    updateFar(far, shown, { x, y, z: z + (1000 * across) / pixels }, 1000);
    return [...far];
  });
  expect(states).toEqual([[], [], [1], [1], []]);
});

test("numbers of vertices go up to the texture's end", () => {
  const { packed } = makeGroup();
  const texels = packed.textureWidth * packed.textureHeight;
  expect(vertexRoom(packed) + (packed.frameCount - 1) * packed.vertexCount).toBe(texels);
  expect(vertexRoom(makeFloor(3).packed)).toBe(16);
});

test("an upload lies over the arrays it was made of and counts their bytes", () => {
  const { packed } = makeGroup();
  const upload = new Upload(packed);
  expect(upload.texture?.image.data).toBe(packed.texels);
  expect(upload.faces(false).index?.array).toBe(packed.faces);
  expect(upload.extra(false)?.index?.array).toBe(packed.extra);
  const corners = packed.faces.byteLength + packed.extra.byteLength;
  expect(upload.bytes).toBe(packed.texels.byteLength + corners);
  expect(upload.faces(true).getAttribute("corner").array).toBe(packed.faces);
  expect(upload.bytes).toBe(packed.texels.byteLength + 2 * corners);
  upload.dropEdges();
  expect(upload.bytes).toBe(packed.texels.byteLength + corners);
});

test("a background has a texture of its vertices only while edges are drawn", () => {
  const { packed } = makeFloor();
  const upload = new Upload(packed);
  const plain = packed.texels.byteLength + packed.faces.byteLength;
  expect([upload.texture, upload.bytes]).toEqual([null, plain]);
  upload.faces(true);
  expect(upload.texture?.image.data?.subarray(0, packed.texels.length)).toEqual(packed.texels);
  expect(upload.bytes).toBe(plain + packed.faces.byteLength + 8 * 2048);
  upload.dropEdges();
  expect([upload.texture, upload.bytes]).toEqual([null, plain]);
});

test("the sphere around an upload holds every vertex of every frame", () => {
  const { packed, positions } = makeGroup();
  const { center, radius } = new Upload(packed).faces(false).boundingSphere!;
  const distances = positions.flat().filter((p) => p !== null).map((p) => Math.hypot(p[0] - center.x, p[1] - center.y, p[2] - center.z));
  expect(Math.max(...distances)).toBeLessThanOrEqual(radius + 1e-6);
});

test("the colours of 21 tracks are all different", () => {
  const colors = Array.from({ length: 21 }, (_, track) => trackColor(track));
  for (const [i, one] of colors.entries()) {
    for (const other of colors.slice(i + 1)) expect(Math.max(...one.map((value, k) => Math.abs(value - other[k])))).toBeGreaterThan(0.05);
  }
});

describe("the order of splats", () => {
  const [COUNT, RANGE] = [500, 65535];
  const box = { minimum: [1, 2, 3], size: [1, 2, 4] } as const;
  const forward: Vector = [0.6, 0, 0.8];
  /** Each on a triangle of its own in the plane x = 0.5, 0.1 m before it or behind. */
  const made = (): { splats: { count: number; words: Uint32Array }; texels: Uint16Array; depths: number[] } => {
    const words = new Uint32Array(SPLAT_WORDS * COUNT);
    const [floats, texels] = [new Float32Array(words.buffer), new Uint16Array(12 * COUNT)];
    const depths = Array.from({ length: COUNT }, (_, k) => {
      const [y, z] = [(k * 7919) % 60_000, (k * 104_729) % 60_000];
      texels.set([32768, y, z, 0, 32768, y + 900, z, 0, 32768, y, z + 900, 0], 12 * k); // looks along +x
      words.set([3 * k, 3 * k + 1, 3 * k + 2, SPLAT_WEIGHT / 2 + ((SPLAT_WEIGHT / 4) << 16)], SPLAT_WORDS * k);
      floats[SPLAT_WORDS * k + 4] = k % 2 === 0 ? 0.1 : -0.1;
      return forward[0] * (0.5 + (k % 2 === 0 ? 0.1 : -0.1)) + (forward[2] * 4 * (z + 225)) / RANGE;
    });
    return { splats: { count: COUNT, words }, texels, depths };
  };

  test("is from the farthest to the nearest, with their offsets, and has each of them once", () => {
    const { splats, texels, depths } = made();
    const order = [...orderSplats(splats, { texels, box, forward })];
    expect([...order].sort((a, b) => a - b)).toEqual(Array.from({ length: COUNT }, (_, k) => k));
    order.slice(1).forEach((k, at) => expect(depths[k]).toBeLessThan(depths[order[at]] + 2 * (5 / RANGE)));
  });

  test("of splats at one depth is that of the file", () => {
    const { splats, texels } = made();
    const flat = { ...box, size: [0, 0, 0] as const };
    new Float32Array(splats.words.buffer).forEach((_, k, all) => void (k % SPLAT_WORDS === 4 && (all[k] = 0)));
    expect([...orderSplats(splats, { texels, box: flat, forward })]).toEqual(Array.from({ length: COUNT }, (_, k) => k));
  });

  test("comes from the page where a worker dies, though it had been asked", () => {
    const { splats, texels } = made();
    const asked: OrderJob[] = [];
    const worker: OrderWorker = { postMessage: (job) => void asked.push(job), terminate: () => undefined, onmessage: null, onerror: null };
    const sorter = new Sorter(() => worker);
    const answers: number[] = [];
    const question = { splats: { ...splats, unit: 1 }, texels, box, forward };
    const key = sorter.join((order) => void answers.push(order.length));
    expect([sorter.ask(key, question), sorter.ask(key, question), asked.length]).toEqual([true, false, 1]);
    worker.onmessage!({ data: { key, order: new Uint32Array(COUNT), texels: asked[0].texels, ms: 3 } });
    expect([sorter.ask(key, question), asked[1].splats, asked[1].texels === asked[0].texels]).toEqual([true, null, true]);
    worker.onerror!(undefined as never);
    expect(sorter.ask(key, question)).toBe(true);
    expect([answers, asked.length]).toEqual([[COUNT, 0, COUNT], 2]);
  });
});
