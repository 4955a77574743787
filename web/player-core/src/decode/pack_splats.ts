// Splats as the GPU takes them; what types.ts says of PackedSplats.

import { FormatError } from "../errors.ts";
import type { DecodedGroup } from "./decoded.ts";
import { locate } from "./splats.ts";
import type { Located, Splats } from "./splats.ts";
import { SPLATS_WIDTH, SPLAT_WEIGHT, SPLAT_WORDS } from "../types.ts";
import type { PackedSplats } from "../types.ts";

const FULL_TURN = 1 << 16;
const MOST = 1 << 22; // splats: their texture has no more rows than nearly every GPU allows, and none draws more in time

/** FormatError where there are more splats than can be shown. */
export function checkShowable(splats: Splats): Splats {
  if (splats.faces.length > MOST) throw new FormatError(`${splats.faces.length} splats: over ${MOST}, more than can be shown`);
  return splats;
}

/** Splats of a group whose base mesh was subdivided `levels` times; `scale`: metres of a normalised length. */
export function packSplats(splats: Splats, group: DecodedGroup, levels: number, scale: number): PackedSplats {
  const count = splats.faces.length;
  const lacking: number[] = []; // words
  const own = new Uint32Array(SPLAT_WORDS * count);
  const floats = new Float32Array(own.buffer);
  for (let k = 0; k < count; k++) {
    const { face, weights, along } = locate(splats, k, levels);
    const [first, isBack] = firstEdge(along);
    const [a, b, c] = [0, 1, 2].map((corner) => (first + corner) % 3);
    const turn = Math.round((splats.turns[k] / (2 * Math.PI)) * FULL_TURN + (isBack ? FULL_TURN / 2 : 0)) % FULL_TURN;
    const at = SPLAT_WORDS * k;
    [a, b, c].forEach((corner, n) => (own[at + n] = group.faces[3 * face + corner]));
    own[at + 3] = Math.round(SPLAT_WEIGHT * weights[b]) | (Math.round(SPLAT_WEIGHT * weights[c]) << 16);
    floats[at + 4] = scale * splats.offsets[k];
    own[at + 5] = turn | (splats.levels[2 * k] << 16) | (splats.levels[2 * k + 1] << 24);
    own[at + 6] = [0, 1, 2].reduce((sum, d) => sum | (byteOf(splats.colors[3 * k + d]) << (8 * d)), byteOf(splats.opacities[k]) << 24);
    const bits = lackingBits(group, face);
    own[at + 7] = bits === null ? 0 : own.length + lacking.length;
    if (bits !== null) lacking.push(...bits);
  }
  const words = new Uint32Array(4 * SPLATS_WIDTH * Math.ceil((own.length + lacking.length) / (4 * SPLATS_WIDTH)));
  words.set(own);
  words.set(lacking, own.length);
  return { count, words, unit: scale * splats.growth };
}

/** The corner that an edge of the face begins at which has the direction of the base face's first edge, and whether it goes the other way. */
function firstEdge(along: Located["along"]): [number, boolean] {
  const first = (along.indexOf(0) + 1) % 3;
  return [first, along[first] > 0];
}

/** A bit for each frame that lacks a face; null where none does. */
function lackingBits({ frameCount, faces, dropped }: DecodedGroup, face: number): number[] | null {
  if (dropped === null) return null;
  const bits = new Array<number>(Math.ceil(frameCount / 32)).fill(0);
  for (let t = 0; t < frameCount; t++) if (dropped[(t * faces.length) / 3 + face]) bits[t >> 5] |= 1 << (t & 31);
  return bits.some((word) => word !== 0) ? bits : null;
}

function byteOf(value: number): number {
  return Math.round(255 * value);
}
