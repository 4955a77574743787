// Faces that single frames are shown without, and small meshes that they are shown with. Beside coding/patches.py.

import type { DecoderModule } from "draco3d";

import { FormatError } from "../errors.ts";
import type { LayersPatches } from "../format/layout.gen.ts";
import { EMPTY, faceCount, vertexCount } from "../mesh.ts";
import type { Mesh } from "../mesh.ts";
import type { Core } from "../wasm/memory.ts";
import { decodeIntegers } from "./entropy.ts";
import { checkGrowth, decodeMesh, roundHalfEven } from "./mesh.ts";
import { LEVELS, stepOf } from "./steps.ts";

const MOST_CELLS = 1 << 20; // of the lattice, over all frames

export interface Patches {
  readonly dropped: Uint8Array | null; // frames x faces
  readonly meshes: readonly Mesh[]; // the additional mesh of each frame
}

/** Decode the patches of a group: `frames` frames, `faces` faces on its finest level. FormatError where damaged. */
export function decodePatches(core: Core, draco: DecoderModule, record: LayersPatches, frames: number, faces: number): Patches {
  if (record.stepLevel >= LEVELS) throw new FormatError(`patches: step level ${record.stepLevel}, there are ${LEVELS}`);
  if (record.runs > 2 * faces + frames * (faces + 1) + 2) throw new FormatError(`patches: ${record.runs} runs over ${frames} frames of ${faces} faces`);
  const runs = decodeIntegers(core, record.dropped, record.runs);
  return { dropped: decodeRuns(runs, frames, faces), meshes: takenIn(core, draco, record, frames) };
}

/** The mask; null where nothing is dropped. FormatError where the runs do not fill it. */
function decodeRuns(runs: Int32Array, frames: number, faces: number): Uint8Array | null {
  if (runs.length === 0) return null;
  const [ever, used] = fillRuns(runs, faces);
  const changing: number[] = [];
  ever.forEach((bit, face) => {
    if (bit) changing.push(face);
  });
  const [turned, all] = fillRuns(runs.subarray(used), frames * changing.length);
  if (used + all !== runs.length) throw new FormatError(`patches: ${runs.length - used - all} runs too many`);
  const dropped = new Uint8Array(frames * faces);
  changing.forEach((face, k) => {
    let gone = 0;
    for (let t = 0; t < frames; t++) dropped[t * faces + face] = gone ^= turned[t * changing.length + k];
  });
  return dropped;
}

/** `count` bits from the first runs, and the number of these runs. FormatError where no run ends with the bits. */
export function fillRuns(runs: Int32Array, count: number): [Uint8Array, number] {
  const bits = new Uint8Array(count);
  let end = 0;
  for (let k = 0; k < runs.length; k++) {
    const length = runs[k];
    if (length < 0 || (length === 0 && k > 0)) throw new FormatError(`patches: a run of length ${length}`);
    if (end + length > count) break;
    if (k % 2 === 1) bits.fill(1, end, end + length);
    end += length;
    if (end === count) return [bits, k + 1];
  }
  throw new FormatError(`patches: runs that do not end with the ${count} faces they tell of`);
}

/** The meshes of each frame out of the one in a record, where they lie side by side along x. */
function takenIn(core: Core, draco: DecoderModule, record: LayersPatches, frames: number): Mesh[] {
  const step = stepOf(record.stepLevel);
  const mesh = decodeMesh(core, draco, record.mesh, step);
  if (faceCount(mesh) === 0) return Array.from({ length: frames }, () => EMPTY);
  checkGrowth(mesh, 0);
  const { width } = record;
  const cells = mesh.vertices.map((value) => roundHalfEven(value / step));
  const fits = width > 0 && width * frames <= MOST_CELLS && cells.every((cell) => Math.abs(cell) <= 2 * MOST_CELLS);
  if (!fits) throw new FormatError(`patches: ${frames} frames, ${width} cells wide`);
  const owners = Int32Array.from({ length: vertexCount(mesh) }, (_, v) => Math.floor((cells[3 * v] + Math.floor(width / 2)) / width));
  for (let v = 0; v < owners.length; v++) cells[3 * v] -= owners[v] * width;
  return parted({ vertices: cells.map((cell) => cell * step), faces: mesh.faces }, owners, frames);
}

/** The faces of each frame and the vertices that they use, in their order. */
function parted(mesh: Mesh, owners: Int32Array, frames: number): Mesh[] {
  const faces = Array.from({ length: frames }, (): number[] => []);
  for (let f = 0; f < mesh.faces.length; f += 3) {
    const owner = owners[mesh.faces[f]];
    const isWhole = owner >= 0 && owner < frames && owners[mesh.faces[f + 1]] === owner && owners[mesh.faces[f + 2]] === owner;
    if (!isWhole) throw new FormatError(`patches: a face that is in none of ${frames} frames, or in two`);
    faces[owner].push(mesh.faces[f], mesh.faces[f + 1], mesh.faces[f + 2]);
  }
  return faces.map((corners) => {
    const used = [...new Set(corners)].sort((a, b) => a - b);
    const place = new Map(used.map((vertex, k) => [vertex, k]));
    const vertices = new Float64Array(3 * used.length);
    used.forEach((vertex, k) => vertices.set(mesh.vertices.subarray(3 * vertex, 3 * vertex + 3), 3 * k));
    return { vertices, faces: Int32Array.from(corners, (vertex) => place.get(vertex)!) };
  });
}
