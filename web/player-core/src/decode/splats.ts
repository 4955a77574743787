// Splats: flat Gaussians on the faces of a base mesh, and where they are when the mesh has moved. Beside
// {geometry,coding/appearance}/splats.py; the player binds them where they are drawn (player-three/src/splat_shaders.ts).

import { FormatError } from "../errors.ts";
import { checkCost } from "../format/budget.ts";
import { Form, Gaussians, GaussiansLayer, LIMITS } from "../format/layout.gen.ts";
import { unpack } from "../format/records.ts";
import type { ColoredMesh } from "../wasm/colors.ts";
import type { Core } from "../wasm/memory.ts";
import { decodeIntegers } from "./entropy.ts";
import type { LayersState } from "./layers.ts";
import { LEVELS, stepOf } from "./steps.ts";

const MOST_BITS = 14; // of a number of a splat
const THIN = 0.1; // third scale, along the normal, of the shorter one

/** Lengths are normalised. */
export interface Splats {
  readonly faces: Int32Array; // of the base mesh
  readonly weights: Float64Array; // of the second and the third corner of each one's face
  readonly offsets: Float64Array; // from the face, along its normal
  readonly turns: Float64Array; // rad, of the longer axis from the face's first edge, about its normal
  readonly levels: Uint8Array; // of the longer and the shorter scale of each
  readonly growth: number; // what the steps of these levels are multiplied by
  readonly opacities: Float64Array; // 0 to 1
  readonly colors: Float64Array; // red, green, blue of each, sRGB, 0 to 1
}

/** Splats of a payload, or of its first layers, on a base mesh of so many faces. FormatError on damaged bytes, or more splats than these may have. */
export function decodeSplats(core: Core, data: Uint8Array, faceCount: number): Splats {
  let [head, offset] = unpack(Gaussians, data);
  const bits = [head.placeBits, head.turnBits, head.opacityBits, head.colorBits];
  const isKnown = head.form === Form.GAUSSIANS && bits.every((some) => some >= 1 && some <= MOST_BITS) && head.offsetLevel < LEVELS;
  if (!isKnown) throw new FormatError(`splats of form ${head.form}, bits ${bits} and offset level ${head.offsetLevel}`);
  const layers: GaussiansLayer[] = [];
  let total = 0;
  while (offset < data.length || layers.length === 0) {
    let layer: GaussiansLayer;
    [layer, offset] = unpack(GaussiansLayer, data, offset);
    if (layer.count === 0) throw new FormatError("splats: a layer without any");
    total += layer.count;
    checkCost(LIMITS.splat * total, data.length, "splats");
    layers.push(layer);
  }
  if (total > head.count) throw new FormatError(`${total} splats of ${head.count}`);
  const splats: Splats = {
    faces: new Int32Array(total),
    weights: new Float64Array(2 * total),
    offsets: new Float64Array(total),
    turns: new Float64Array(total),
    levels: new Uint8Array(2 * total),
    growth: Math.sqrt(Math.sqrt(head.count / total)),
    opacities: new Float64Array(total),
    colors: new Float64Array(3 * total),
  };
  let first = 0;
  for (const layer of layers) {
    decodeLayer(core, layer, head, faceCount, splats, first);
    first += layer.count;
  }
  return splats;
}

/** Puts the splats of a layer where they belong, from number `first` on. */
function decodeLayer(core: Core, layer: GaussiansLayer, head: Gaussians, faceCount: number, splats: Splats, first: number): void {
  const n = layer.count;
  const read = (data: Uint8Array, rows = 1): Int32Array => decodeIntegers(core, data, rows * n);
  const [faces, places, offsets, turns] = [read(layer.faces), read(layer.places, 2), read(layer.offsets), read(layer.turns)];
  const [scales, opacities, colors] = [read(layer.scales, 2), read(layer.opacities), read(layer.colors, 3)];
  const [size, mostTurn, mostOpacity, fine] = [1 << head.placeBits, (1 << head.turnBits) - 1, 1 << head.opacityBits, 1 << head.colorBits];
  const step = stepOf(head.offsetLevel);
  let [face, luma, orange, green] = [0, 0, 0, 0];
  for (let k = 0; k < n; k++) {
    const at = first + k;
    face += faces[k];
    [luma, orange, green] = [luma + colors[k], orange + colors[n + k], green + colors[2 * n + k]];
    const [b, c, longer] = [places[k], places[n + k], head.scaleLevel + scales[k]];
    const limits = [
      [face, faceCount - 1], [b, size], [c, size], [b + c, size], [turns[k], mostTurn], [longer, LEVELS - 1],
      [scales[n + k], LEVELS - 1], [longer + scales[n + k], LEVELS - 1], [opacities[k], mostOpacity],
    ];
    if (limits.some(([value, most]) => value < 0 || value > most)) throw new FormatError(`splat ${at}: ${limits.map(([value]) => value)}, beyond ${limits.map(([, most]) => most)}`);
    splats.faces[at] = face;
    splats.weights.set([b / size, c / size], 2 * at);
    splats.offsets[at] = offsets[k] * step;
    splats.turns[at] = turns[k] * (Math.PI / (mostTurn + 1));
    splats.levels.set([longer, longer + scales[n + k]], 2 * at);
    splats.opacities[at] = opacities[k] / mostOpacity;
    splats.colors.set([luma - green + orange, luma + green, luma - green - orange].map((value) => Math.min(Math.max(value / fine, 0), 1)), 3 * at);
  }
}

/** The splats of a group before that a group has, too; null where its base mesh is another. */
export function inherited(before: Pick<LayersState, "faces" | "splats"> | null, template: ColoredMesh | undefined): Splats | null {
  return before !== null && template?.base.faces.length === before.faces.length ? before.splats : null;
}

type Triple = readonly [number, number, number];

/** A place on the mesh after some subdivisions. */
export interface Located {
  readonly face: number;
  readonly weights: Triple; // of its corners
  readonly along: Triple; // of its corners, in the direction of the base face's first edge: -1, 0 and 1
}

/** Where splat k is after so many subdivisions. */
export function locate({ faces, weights: known }: Splats, k: number, levels: number): Located {
  let face = faces[k];
  let [a, b, c] = [1 - known[2 * k] - known[2 * k + 1], known[2 * k], known[2 * k + 1]];
  let along: Triple = [-1, 1, 0];
  for (let level = 0; level < levels; level++) {
    const most = Math.max(a, b, c);
    const child = most < 0.5 ? 3 : a === most ? 0 : b === most ? 1 : 2;
    if (child < 3) [a, b, c] = [2 * a - (child === 0 ? 1 : 0), 2 * b - (child === 1 ? 1 : 0), 2 * c - (child === 2 ? 1 : 0)];
    else {
      [a, b, c] = [1 - 2 * c, 1 - 2 * a, 1 - 2 * b];
      along = [0 - along[2], 0 - along[0], 0 - along[1]];
    }
    face = 4 * face + child;
  }
  return { face, weights: [a, b, c], along };
}

/** The mesh of a frame that carries splats: the base mesh after some subdivisions. */
export interface Carrier {
  readonly vertices: Float64Array;
  readonly faces: Int32Array;
  readonly levels: number;
  readonly dropped: Uint8Array | null; // 1 for a face that the frame lacks
  readonly unit: number; // what lengths of splats count, in the unit of the vertices
}

/** A Gaussian in space. */
export interface Bound {
  readonly means: Triple;
  readonly axes: readonly Triple[]; // along the longer scale, the shorter, and the normal
  readonly scales: Triple; // standard deviations along these
  readonly opacities: number; // 0 where the frame lacks the face, or that has no area
  readonly colors: Triple; // sRGB, 0 to 1
}

/** Splat k in a frame. */
export function bind(splats: Splats, k: number, { vertices, faces, levels, dropped, unit }: Carrier): Bound {
  const { face, weights, along } = locate(splats, k, levels);
  const [p, q, r] = [0, 1, 2].map((corner): Triple => triple((d) => vertices[3 * faces[3 * face + corner] + d]));
  const first = unitOf(triple((d) => along[0] * p[d] + along[1] * q[d] + along[2] * r[d]));
  const normal = unitOf(cross(triple((d) => q[d] - p[d]), triple((d) => r[d] - p[d])));
  const second = cross(normal, first);
  const [cosine, sine] = [Math.cos(splats.turns[k]), Math.sin(splats.turns[k])];
  const axes = [triple((d) => cosine * first[d] + sine * second[d]), triple((d) => cosine * second[d] - sine * first[d]), normal];
  const [longer, shorter] = [0, 1].map((side) => unit * splats.growth * stepOf(splats.levels[2 * k + side]));
  const isThere = axes.every((axis) => axis.some((value) => value !== 0)) && !dropped?.[face];
  return {
    means: triple((d) => weights[0] * p[d] + weights[1] * q[d] + weights[2] * r[d] + unit * splats.offsets[k] * normal[d]),
    axes,
    scales: [longer, shorter, THIN * shorter],
    opacities: isThere ? splats.opacities[k] : 0,
    colors: triple((d) => splats.colors[3 * k + d]),
  };
}

function triple(of: (d: number) => number): Triple {
  return [of(0), of(1), of(2)];
}

function cross(u: Triple, v: Triple): Triple {
  return triple((d) => u[(d + 1) % 3] * v[(d + 2) % 3] - u[(d + 2) % 3] * v[(d + 1) % 3]);
}

function unitOf(v: Triple): Triple {
  const length = Math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) || 1;
  return triple((d) => v[d] / length);
}
