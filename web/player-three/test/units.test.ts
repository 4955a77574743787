// What needs no GPU: normals' codes, ranges, colours.

import { expect, test } from "vitest";

import { trackColor } from "../src/colors.ts";
import { decodeNormal, encodeNormal } from "../src/octahedral.ts";
import type { Vector } from "../src/octahedral.ts";
import { localFrame, triangleCount, vertexRoom } from "../src/ranges.ts";
import { makeFloor, makeGroup } from "./analytic.ts";

test("every direction comes back within a degree, and the axes exactly enough to be told apart", () => {
  for (let k = 0; k < 5000; k++) {
    const z = 1 - (2 * (k + 0.5)) / 5000;
    const around = k * 2.399963; // golden angle
    const radius = Math.sqrt(1 - z * z);
    const n: Vector = [radius * Math.cos(around), radius * Math.sin(around), z];
    const back = decodeNormal(encodeNormal(n));
    expect(back[0] * n[0] + back[1] * n[1] + back[2] * n[2]).toBeGreaterThan(Math.cos(Math.PI / 180));
  }
  expect(decodeNormal(encodeNormal([0, 0, 0]))[2]).toBeGreaterThan(0.9999);
});

test("a frame beside its group counts as its nearest one", () => {
  const { packed } = makeGroup({ firstFrame: 10, frameCount: 4 });
  expect([3, 10, 12, 99].map((frame) => localFrame(packed, frame))).toEqual([0, 0, 2, 3]);
});

test("triangles are those of all frames and those of the frame", () => {
  const { packed } = makeGroup({ frameCount: 4, squareFrame: 2 });
  const always = packed.faces.length / 3;
  expect([0, 1, 2, 3].map((frame) => triangleCount(packed, frame))).toEqual([always, always, always + 2, always]);
  const floor = makeFloor().packed;
  expect(triangleCount(floor, 7)).toBe(floor.faces.length / 3);
  expect(vertexRoom(floor)).toBe(floor.vertexCount);
  expect(vertexRoom(packed)).toBe(packed.textureWidth * packed.textureHeight - 3 * packed.vertexCount);
});

test("twenty tracks have twenty colours", () => {
  const colours = Array.from({ length: 20 }, (_, track) => trackColor(track).map((share) => share.toFixed(3)).join());
  expect(new Set(colours).size).toBe(20);
});
