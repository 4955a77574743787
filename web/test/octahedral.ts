// Octahedral normals for tests, as core/wasm/packing.cpp makes them and the vertex shader (player-three/src/shaders.ts) takes them apart.

import type { Vector } from "@meshreel/player-three/colors";

/** The code of a normal of any length: 8 bits each, the first number in the low byte. (0, 0, 0) gives +z. */
export function encodeNormal([x, y, z]: Vector): number {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let u = sum > 0 ? x / sum : 0;
  let v = sum > 0 ? y / sum : 0;
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  return byteOf(u) | (byteOf(v) << 8);
}

/** The unit normal of a code. */
export function decodeNormal(code: number): Vector {
  let x = (code & 255) / 127.5 - 1;
  let y = (code >> 8) / 127.5 - 1;
  const z = 1 - Math.abs(x) - Math.abs(y);
  const fold = Math.max(-z, 0);
  x += x >= 0 ? -fold : fold;
  y += y >= 0 ? -fold : fold;
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

function byteOf(value: number): number {
  return Math.floor((value + 1) * 127.5 + 0.5);
}
