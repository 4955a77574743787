// Atlases: where the corners of a base mesh's faces are in a texture. Beside coding/appearance/atlas.py.

import { FormatError } from "../errors.ts";
import { Atlas, Form } from "../format/layout.gen.ts";
import { unpackAll } from "../format/records.ts";
import { MOST_SIDE } from "../format/renditions.ts";
import type { Mesh } from "../mesh.ts";
import { decodePlaces } from "../wasm/places.ts";
import type { Core } from "../wasm/memory.ts";
import { decodeIntegers } from "./entropy.ts";


/** A texture's size, and the places of the corners of a mesh's faces in it, from its upper left corner. */
export interface Layout {
  readonly width: number; // texels
  readonly height: number;
  readonly places: Int32Array; // right and down, of three corners a face
}

/** The places of a base mesh's corners. FormatError on damaged bytes, or those of another mesh. */
export function decodeAtlas(core: Core, data: Uint8Array, base: Mesh): Layout {
  const record = unpackAll(Atlas, data);
  const { width, height } = record;
  if (record.form !== Form.PLACES || ![width, height].every(isSide)) throw new FormatError(`an atlas of form ${record.form}, ${width} x ${height} texels`);
  const faces = base.faces.length / 3;
  const counts = [record.joinCount, record.startCount, record.restCount];
  if (counts.some((count, k) => count > [4, 6, 2][k] * faces)) throw new FormatError(`an atlas of ${counts} symbols for ${faces} faces`);
  const [joins, starts, rests] = [record.joins, record.starts, record.rests].map((stream, k) => decodeIntegers(core, stream, counts[k]));
  const places = decodePlaces(core, base, { joins, starts, rests });
  const isInside = places.every((place, k) => place >= 0 && place <= (k % 2 === 0 ? width : height));
  if (!isInside) throw new FormatError(`an atlas with places beyond its ${width} x ${height} texels`);
  return { width, height, places };
}

function isSide(side: number): boolean {
  return side > 0 && side <= MOST_SIDE && side % 2 === 0;
}

/** Places of the corners of the faces that `levels` subdivisions make, in texels; NaN for those of faces that have none. */
export function finerPlaces({ places }: Layout, levels: number): Float32Array {
  let finer = Float32Array.from(places); // texels cut in two up to twelve times are exact
  for (let f = 0; f < finer.length; f += 6) if (isPoint(places, f)) finer.fill(NaN, f, f + 6);
  for (let count = 0; count < levels; count++) finer = cut(finer);
  return finer;
}

function isPoint(places: Int32Array, f: number): boolean {
  const [x, y] = [places[f], places[f + 1]];
  return places[f + 2] === x && places[f + 3] === y && places[f + 4] === x && places[f + 5] === y;
}

/** Triangles cut in four, in the order in which faces are subdivided. */
function cut(places: Float32Array): Float32Array<ArrayBuffer> {
  const finer = new Float32Array(4 * places.length);
  for (let f = 0; f < places.length; f += 6) {
    for (let k = 0; k < 2; k++) {
      const [a, b, c] = [places[f + k], places[f + 2 + k], places[f + 4 + k]];
      const [ab, bc, ca] = [(a + b) / 2, (b + c) / 2, (c + a) / 2];
      const corners = [a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca];
      for (let n = 0; n < 12; n++) finer[4 * f + 2 * n + k] = corners[n];
    }
  }
  return finer;
}
