// The form LAYERS: a coarse mesh and its motion, then for each midpoint subdivision a scalar a new vertex and frame.
// Beside coding/layers.py.

import type { DecoderModule } from "draco3d";

import { FormatError } from "../errors.ts";
import { LayersGroup, LayersLevel, Origin, Presence } from "../format/layout.gen.ts";
import { vertexCount } from "../mesh.ts";
import type { Mesh, Placement } from "../mesh.ts";
import { unpack } from "../format/records.ts";
import type { Neighbours } from "../wasm/entropy.ts";
import { fieldInverse, framesOfRows, hierarchy, placeRows, refineField, refineFieldFrames, siblingWeights, siblings, subdivide } from "../wasm/layers.ts";
import type { FieldValues, Level } from "../wasm/layers.ts";
import type { Core } from "../wasm/memory.ts";
import { readField } from "./fields.ts";
import { checkGrowth, checkStep, decodeMesh } from "./mesh.ts";

const MOST_NUMBERS = 2 ** 29; // of decoded places

/** What follows from the coarser level's faces alone, so that groups which share them share it. */
interface Connectivity {
  readonly level: Level;
  readonly siblings: Neighbours;
}

/** What the next group may be predicted from. */
export interface LayersState {
  readonly faces: Int32Array; // of the base
  readonly base: Float64Array; // its vertices in the last frame
  readonly scalars: readonly Float64Array[]; // of the last frame, for each level decoded
  readonly finer: readonly Connectivity[];
}

/** The records of a payload, or those of its first levels. */
export interface LayersRecords {
  readonly head: LayersGroup;
  readonly levels: readonly LayersLevel[];
  readonly end: number; // offset behind them
}

export interface DecodedLayers {
  readonly faces: Int32Array;
  readonly positions: Float64Array; // T x V x 3
  readonly state: LayersState;
}

export function readLayers(data: Uint8Array, levels: number | null): LayersRecords {
  let [head, offset] = unpack(LayersGroup, data);
  const records: LayersLevel[] = [];
  for (let count = Math.min(levels ?? head.levels, head.levels); count > 0; count--) {
    const [record, end] = unpack(LayersLevel, data, offset);
    records.push(record);
    offset = end;
  }
  return { head, levels: records, end: offset };
}

/** What records decode to, placed; the state never is. FormatError on damaged records, or where `previous` lacks. */
export function placeLayers(core: Core, draco: DecoderModule, records: LayersRecords, previous: LayersState | null, place: Placement): DecodedLayers {
  const { head } = records;
  if (head.origin !== Origin.PREVIOUS) previous = null;
  const base = baseOf(draco, head, previous);
  const frames = head.frames;
  let rows = trajectories(core, head, base);
  const last = lastOf(rows, vertexCount(base), frames);
  const scalars: Float64Array[] = [];
  const finer: Connectivity[] = [];
  let [faces, vertices] = [base.faces, vertexCount(base)];
  let positions: Float64Array | null = null;
  records.levels.forEach((record, k) => {
    const near = previous?.finer[k] ?? connectivity(core, faces, vertices);
    const count = vertices + near.level.edges.length / 2;
    if (3 * frames * count > MOST_NUMBERS) throw new FormatError(`${frames} frames of ${near.level.faces.length / 3} faces exceed ${MOST_NUMBERS} numbers`);
    const field = scalarsOf(core, record, near.siblings, frames, previous?.scalars[k] ?? null);
    const refinement = { level: near.level, field, curvature: record.curvature };
    if (k + 1 < records.levels.length) {
      const [refined, offsets] = refineField(core, rows, refinement);
      rows = refined;
      scalars.push(offsets);
    } else {
      const shown = refineFieldFrames(core, rows, refinement, place);
      positions = shown.positions;
      scalars.push(shown.last);
    }
    [faces, vertices] = [near.level.faces, count];
    finer.push(near);
  });
  positions ??= framesOfRows(core, rows, vertices, place);
  return { faces, positions, state: { faces: base.faces, base: last, scalars, finer } };
}

function baseOf(draco: DecoderModule, head: LayersGroup, previous: LayersState | null): Mesh {
  checkStep(head.step);
  if (head.frames === 0) throw new FormatError("layers: a group of 0 frames");
  let base: Mesh;
  if (head.origin === Origin.ALONE) base = decodeMesh(draco, head.base, head.step);
  else if (previous === null) throw new FormatError("layers: a group that is predicted from one which is not at hand");
  else if (head.base.length > 0) throw new FormatError(`layers: a base mesh of ${head.base.length} bytes in a group that has another's`);
  else base = { vertices: previous.base, faces: previous.faces };
  checkGrowth(base, head.levels, head.frames);
  return base;
}

/** Where the base's vertices are in every frame, as rows. */
function trajectories(core: Core, head: LayersGroup, base: Mesh): Float64Array {
  const { order, graph } = hierarchy(core, base);
  const field = readField(core, head.motion, graph, 3 * head.frames, head.hasMean === Presence.PRESENT);
  return placeRows(core, fieldInverse(core, field), order, base.vertices);
}

/** The last frame of rows, vertex after vertex. */
function lastOf(rows: Float64Array, vertices: number, frames: number): Float64Array {
  return Float64Array.from({ length: 3 * vertices }, (_, k) => rows[k * frames + frames - 1]);
}

function connectivity(core: Core, faces: Int32Array, vertices: number): Connectivity {
  const level = subdivide(core, faces, vertices);
  return { level, siblings: siblings(core, level) };
}

function scalarsOf(core: Core, record: LayersLevel, near: Neighbours, frames: number, before: Float64Array | null): FieldValues {
  const field = readField(core, record.scalars, siblingWeights(core, near, record.siblingWeight), frames, false);
  if (record.origin === Origin.ALONE) return field;
  if (before === null || before.length !== near.starts.length - 1) {
    throw new FormatError("a level that is counted from a group which is not at hand, or not to this level");
  }
  return { ...field, before };
}
