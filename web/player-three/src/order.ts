// The order in which splats are drawn: from the farthest to the nearest. Pure: runs in a worker, or on the page.

import { SPLAT_WEIGHT, SPLAT_WORDS } from "@meshreel/player-core/types";
import type { Box, PackedSplats } from "@meshreel/player-core/types";
import type { Vector } from "./colors.ts";

/** Splats of a group, a frame of it, and where one looks. */
export interface OrderJob {
  readonly key: number; // of who asks
  readonly splats: Pick<PackedSplats, "count" | "words"> | null; // null: those of the job before with the same key
  readonly texels: Uint16Array; // of the vertices that are there in every frame, in this one
  readonly box: Box;
  readonly forward: Vector; // a unit vector, away from the eye
}

export interface Ordered {
  readonly key: number;
  readonly order: Uint32Array; // numbers of all splats
  readonly texels: Uint16Array; // those of the job, to be filled again
  readonly ms: number;
}

const KEYS = 1 << 16; // steps of depth: of a person some 30 micrometres

/** Sorts by counting, so that it takes the same time whatever the splats are. */
export function orderSplats({ count, words }: Pick<PackedSplats, "count" | "words">, { texels, box, forward }: Omit<OrderJob, "splats" | "key">): Uint32Array {
  const [dx, dy, dz] = box.size.map((size) => size / 65535);
  const [fx, fy, fz] = [forward[0] * dx, forward[1] * dy, forward[2] * dz];
  const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
  const depths = new Float32Array(count);
  let [near, far] = [Infinity, -Infinity];
  for (let k = 0; k < count; k++) {
    const at = SPLAT_WORDS * k;
    const [p, q, r] = [4 * words[at], 4 * words[at + 1], 4 * words[at + 2]];
    const [b, c] = [(words[at + 3] & 0xffff) / SPLAT_WEIGHT, (words[at + 3] >>> 16) / SPLAT_WEIGHT];
    const [x, y, z] = [texels[p], texels[p + 1], texels[p + 2]];
    const [bx, by, bz] = [texels[q] - x, texels[q + 1] - y, texels[q + 2] - z];
    const [cx, cy, cz] = [texels[r] - x, texels[r + 1] - y, texels[r + 2] - z];
    let depth = fx * (x + b * bx + c * cx) + fy * (y + b * by + c * cy) + fz * (z + b * bz + c * cz);
    const offset = floats[at + 4];
    if (offset !== 0) {
      const [nx, ny, nz] = [dy * dz * (by * cz - bz * cy), dz * dx * (bz * cx - bx * cz), dx * dy * (bx * cy - by * cx)];
      const length = Math.sqrt(nx * nx + ny * ny + nz * nz);
      if (length > 0) depth += (offset * (forward[0] * nx + forward[1] * ny + forward[2] * nz)) / length;
    }
    depths[k] = depth;
    if (depth < near) near = depth;
    if (depth > far) far = depth;
  }
  return counted(depths, near, far);
}

/** The numbers of depths, the largest first. */
function counted(depths: Float32Array, near: number, far: number): Uint32Array {
  const share = far > near ? (KEYS - 1) / (far - near) : 0;
  const starts = new Uint32Array(KEYS + 1);
  const keys = new Uint16Array(depths.length);
  for (let k = 0; k < depths.length; k++) {
    keys[k] = (far - depths[k]) * share;
    starts[keys[k] + 1]++;
  }
  for (let key = 0; key < KEYS; key++) starts[key + 1] += starts[key];
  const order = new Uint32Array(depths.length);
  for (let k = 0; k < depths.length; k++) order[starts[keys[k]]++] = k;
  return order;
}
