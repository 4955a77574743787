import { expect, test } from "vitest";
import { trackColor } from "../src/colors.ts";
import type { Shown } from "@meshreel/player-core/types";
import { updateFar } from "../src/far.ts";
import { localFrame, triangleCount, vertexRoom } from "../src/ranges.ts";
import { Upload } from "../src/upload.ts";
import { makeFloor, makeGroup } from "./analytic.ts";

test("a frame shows the group's triangles and its own, and a frame beside the group its nearest", () => {
  const { packed } = makeGroup({ firstFrame: 10 });
  const sphereTriangles = packed.faces.length / 3;
  expect([9, 10, 11, 12, 13, 14].map((frame) => localFrame(packed, frame))).toEqual([0, 0, 1, 2, 3, 3]);
  expect([10, 11, 12, 13].map((frame) => triangleCount(packed, frame) - sphereTriangles)).toEqual([0, 0, 2, 0]);
  expect(triangleCount(makeFloor(3).packed, 5)).toBe(18);
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
