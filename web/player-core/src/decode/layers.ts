// The form LAYERS: a coarse mesh and its motion, then for each midpoint subdivision a scalar a new vertex and frame.
// Beside coding/layers.py.

import type { DecoderModule } from "draco3d";

import { FormatError } from "../errors.ts";
import { checkCost, layersCost } from "../format/budget.ts";
import { LayersGroup, LayersLevel, Origin } from "../format/layout.gen.ts";
import { unpack } from "../format/records.ts";
import { vertexCount } from "../mesh.ts";
import type { Mesh, Placement } from "../mesh.ts";
import { connectivity, decodeLastLevel, decodeLevel, decodeMotion, framesOfRows } from "../wasm/layers.ts";
import type { Connectivity } from "../wasm/layers.ts";
import type { Core } from "../wasm/memory.ts";
import type { Layout } from "./atlas.ts";
import type { Splats } from "./splats.ts";
import { checkGrowth, checkStep, decodeMesh } from "./mesh.ts";

const MOST_NUMBERS = 2 ** 29; // of decoded places: 4 GiB, as in Python

/** What the next group may be predicted from. */
export interface LayersState {
  readonly faces: Int32Array; // of the base
  readonly base: Float64Array; // its vertices in the last frame
  readonly scalars: readonly Float64Array[]; // of the last frame, for each level decoded
  readonly finer: readonly Connectivity[];
  readonly colors: Float64Array | null; // values of the colours of all decoded vertices (colors.ts)
  readonly layout: Layout | null; // of the textures of its chain (atlas.ts)
  readonly splats: Splats | null; // of its chain
}

/** The records of a payload, or those of its first levels. */
export interface LayersRecords {
  readonly head: LayersGroup;
  readonly layers: readonly Uint8Array[]; // the LayersGroup, then a LayersLevel for each level, as bytes
  readonly end: number; // offset behind them
}

export interface DecodedLayers {
  readonly base: Mesh;
  readonly faces: Int32Array;
  readonly positions: Float64Array; // T x V x 3
  readonly state: LayersState;
}

export function readLayers(data: Uint8Array, levels: number | null): LayersRecords {
  let [head, end] = unpack(LayersGroup, data);
  const layers = [data.subarray(0, end)];
  for (let count = Math.min(levels ?? head.levels, head.levels); count > 0; count--) {
    const start = end;
    [, end] = unpack(LayersLevel, data, start);
    layers.push(data.subarray(start, end));
  }
  return { head, layers, end };
}

/** What records decode to, placed; the state never is. FormatError on damaged records, or where `previous` lacks. */
export function placeLayers(core: Core, draco: DecoderModule, records: LayersRecords, previous: LayersState | null, place: Placement): DecodedLayers {
  const { head, layers } = records;
  if (head.origin !== Origin.PREVIOUS) previous = null;
  const base = baseOf(core, draco, head, previous);
  const frames = head.frames;
  checkCost(layersCost(base, layers.length - 1, frames), records.end, "layers");
  let rows = decodeMotion(core, layers[0], base, frames);
  const last = lastOf(rows, vertexCount(base), frames);
  const scalars: Float64Array[] = [];
  const finer: Connectivity[] = [];
  let [faces, vertices] = [base.faces, vertexCount(base)];
  let positions: Float64Array | null = null;
  layers.slice(1).forEach((record, k) => {
    const near = previous?.finer[k] ?? connectivity(core, faces, vertices);
    const count = vertices + near.level.edges.length / 2;
    if (3 * frames * count > MOST_NUMBERS) throw new FormatError(`${frames} frames of ${near.level.faces.length / 3} faces exceed ${MOST_NUMBERS} numbers`);
    const coarser = { frames, near, rows, previous: previous?.scalars[k] ?? null };
    const isLast = k + 2 === layers.length;
    const [refined, ofLast] = isLast ? decodeLastLevel(core, record, coarser, place) : decodeLevel(core, record, coarser);
    if (isLast) positions = refined;
    else rows = refined;
    scalars.push(ofLast);
    [faces, vertices] = [near.level.faces, count];
    finer.push(near);
  });
  positions ??= framesOfRows(core, rows, vertices, place);
  return { base, faces, positions, state: { faces: base.faces, base: last, scalars, finer, colors: null, layout: null, splats: null } };
}

function baseOf(core: Core, draco: DecoderModule, head: LayersGroup, previous: LayersState | null): Mesh {
  checkStep(head.step);
  if (head.frames === 0) throw new FormatError("layers: a group of 0 frames");
  let base: Mesh;
  if (head.origin === Origin.ALONE) base = decodeMesh(core, draco, head.base, head.step);
  else if (previous === null) throw new FormatError("layers: a group that is predicted from one which is not at hand");
  else if (head.base.length > 0) throw new FormatError(`layers: a base mesh of ${head.base.length} bytes in a group that has another's`);
  else base = { vertices: previous.base, faces: previous.faces };
  checkGrowth(base, head.levels, head.frames);
  return base;
}

/** The last frame of rows, vertex after vertex. */
function lastOf(rows: Float64Array, vertices: number, frames: number): Float64Array {
  return Float64Array.from({ length: 3 * vertices }, (_, k) => rows[k * frames + frames - 1]);
}
