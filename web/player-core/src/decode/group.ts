// Payloads of chunks: groups of frames of whatever form, and states of the background. Beside coding/{group,intra,background}.py.

import type { DecoderModule } from "draco3d";

import { FormatError } from "../errors.ts";
import { changeCost, checkCost, dracoCost, elementsOf, laplacianCost } from "../format/budget.ts";
import { DracoGroup, EmptyGroup, Form, LaplacianGroup, LayersPatches, StaticPatch } from "../format/layout.gen.ts";
import { EMPTY, concatenate, faceCount, placed, vertexCount, without } from "../mesh.ts";
import type { Mesh, Placement } from "../mesh.ts";
import { unpackAll } from "../format/records.ts";
import { checkClaims } from "../wasm/draco.ts";
import type { Core } from "../wasm/memory.ts";
import type { ColoredMesh } from "../wasm/colors.ts";
import { decodeColors } from "./colors.ts";
import type { Canvas, StaticCanvas } from "./colors.ts";
import { ofMeshes } from "./decoded.ts";
import type { DecodedGroup, GroupColors } from "./decoded.ts";
import { claimsOf, decodeDisplacements } from "./displacements.ts";
import { decodeIntegers } from "./entropy.ts";
import { placeLayers, readLayers } from "./layers.ts";
import type { LayersState } from "./layers.ts";
import { checkGrowth, checkStep, decodeMesh, subdivideMidpoint } from "./mesh.ts";
import { decodePatches, fillRuns } from "./patches.ts";

/** What decodes: the compiled core, and Draco. */
export interface Tools {
  readonly core: Core;
  readonly draco: DecoderModule;
}

/** A group as decoded and placed, and what the next may be predicted from. */
export interface Continued {
  readonly group: DecodedGroup;
  readonly state: LayersState | null;
  readonly canvas: Canvas; // what its colours are coded over
}

/** What decoding a group needs in addition to its payload. */
export interface GroupContext {
  readonly frameCount: number; // as the index has it
  readonly layers: number | null; // layers beyond the first, at most; null: all
  readonly previous: LayersState | null; // that the group before gave
  readonly place: Placement;
}

/** The frames of a group, from a whole payload or a prefix of its layers. FormatError on damaged bytes. */
export function continueGroup(tools: Tools, data: Uint8Array, context: GroupContext): Continued {
  const { frameCount } = context;
  const made = data[0] === Form.LAYERS ? decodeLayers(tools, data, context) : decodeAlone(tools, data, context);
  if (made.group.frameCount !== frameCount) throw new FormatError(`a group of ${made.group.frameCount} frames where the index says ${frameCount}`);
  return made;
}

function decodeLayers({ core, draco }: Tools, data: Uint8Array, { layers, previous, place }: GroupContext): Continued {
  const records = readLayers(data, layers);
  const { base, faces, positions, state } = placeLayers(core, draco, records, previous, place);
  const frameCount = records.head.frames;
  const vertices = positions.length / 3 / frameCount;
  const group = { frameCount, vertexCount: vertices, positions, faces, dropped: null, patches: null };
  const template = { base, levels: records.layers.length - 1, frames: frameCount, vertices };
  const isPlain = records.end === data.length || (layers !== null && layers <= records.head.levels);
  if (isPlain) return { group, state, canvas: [template] };
  const record = unpackAll(LayersPatches, data.subarray(records.end));
  const { dropped, meshes } = decodePatches(core, draco, record, frameCount, faces.length / 3);
  const added = wholeOf(concatenate(meshes));
  const canvas = added.vertices > 0 ? [template, added] : [template];
  return { group: { ...group, dropped, patches: meshes.map((mesh) => placed(mesh, place)) }, state, canvas };
}

/** A mesh whose colours are coded over itself. */
function wholeOf(base: Mesh): ColoredMesh {
  return { base, levels: 0, frames: 1, vertices: vertexCount(base) };
}

/** The colours of a group that was decoded from as many layers; its state then has what the next colours may be predicted from. */
export function colorGroup(core: Core, made: Continued, data: Uint8Array, { layers, previous }: Pick<GroupContext, "layers" | "previous">): [GroupColors, LayersState | null] {
  const { canvas, state } = made;
  let before = previous?.colors ?? null;
  if (layers !== null) before = before && before.subarray(0, 3 * (canvas[0]?.vertices ?? 0)); // the group before may have finer levels
  const { colors, last } = decodeColors(core, data, canvas, before);
  return [colors, state && { ...state, colors: last }];
}

function decodeAlone(tools: Tools, data: Uint8Array, { frameCount, layers, place }: GroupContext): Continued {
  switch (data[0]) {
    case Form.EMPTY:
      unpackAll(EmptyGroup, data);
      return { group: ofMeshes(Array.from({ length: frameCount }, () => EMPTY)), state: null, canvas: [] };
    case Form.DRACO: {
      const meshes = decodeIntra(tools, data);
      const canvas = meshes.map(({ colored }) => colored).filter(({ vertices }) => vertices > 0);
      return { group: ofMeshes(meshes.map(({ mesh }) => placed(mesh, place))), state: null, canvas };
    }
    case Form.LAPLACIAN: {
      const { group, reference } = decodeLaplacian(tools, data, layers, place);
      return { group, state: null, canvas: [reference] };
    }
    default:
      throw new FormatError(`group form ${data[0]} is not known to this player`);
  }
}

/** A mesh, and what its colours are coded over. */
interface IntraMesh {
  readonly mesh: Mesh;
  readonly colored: ColoredMesh;
}

function decodeIntra({ core, draco }: Tools, data: Uint8Array): IntraMesh[] {
  const record = unpackAll(DracoGroup, data);
  checkStep(record.step);
  checkClaims(core, record.meshes); // of all frames together
  const meshes = record.meshes.map((frame) => decodeMesh(core, draco, frame, record.step));
  for (const mesh of meshes) checkGrowth(mesh, record.levels, meshes.length);
  checkCost(dracoCost(meshes.map((mesh) => elementsOf(mesh, record.levels))), data.length, "draco");
  return meshes.map((base) => {
    const mesh = subdivideMidpoint(core, base, record.levels);
    return { mesh, colored: { base, levels: record.levels, frames: 1, vertices: vertexCount(mesh) } };
  });
}

function decodeLaplacian({ core, draco }: Tools, data: Uint8Array, layers: number | null, place: Placement): { group: DecodedGroup; reference: ColoredMesh } {
  const record = unpackAll(LaplacianGroup, data);
  checkStep(record.step);
  const reference = decodeMesh(core, draco, record.reference, record.step);
  const [frameCount, components] = claimsOf(record.displacements);
  checkGrowth(reference, record.levels, frameCount);
  checkCost(laplacianCost(reference, record.levels, frameCount, components), data.length, "laplacian");
  const base = subdivideMidpoint(core, reference, record.levels);
  const field = decodeDisplacements(core, record.displacements, base, layers);
  const count = vertexCount(base);
  const positions = new Float64Array(field.length);
  for (let t = 0; t < frameCount; t++) {
    for (let v = 0; v < count; v++) {
      for (let k = 0; k < 3; k++) {
        const normalised = base.vertices[3 * v + k] + field[3 * (v * frameCount + t) + k];
        positions[3 * (t * count + v) + k] = place.origin[k] + place.scale * normalised;
      }
    }
  }
  const group = { frameCount, vertexCount: count, positions, faces: base.faces, dropped: null, patches: null };
  return { group, reference: { base: reference, levels: record.levels, frames: frameCount, vertices: count } };
}

/** A state of the background, placed; `before` is the one that it changes, as this gave it. FormatError on damaged bytes. */
export function decodeStatic(tools: Tools, data: Uint8Array, before: Mesh | null, place: Placement): StaticCanvas {
  if (data[0] === Form.PATCH) {
    if (before === null) throw new FormatError("background: a patch of a state that is not at hand");
    return decodeChange(tools, data, before, place);
  }
  const meshes = decodeIntra(tools, data);
  if (meshes.length !== 1) throw new FormatError(`background: ${meshes.length} meshes, a state has one`);
  const [{ mesh, colored }] = meshes;
  return { mesh: placed(mesh, place), added: wholeOf(colored.base), isChange: false };
}

function decodeChange({ core, draco }: Tools, data: Uint8Array, before: Mesh, place: Placement): StaticCanvas {
  const record = unpackAll(StaticPatch, data);
  checkStep(record.step);
  const kept = keptOf(core, record, before);
  const added = decodeMesh(core, draco, record.mesh, record.step);
  checkGrowth(added, 0);
  checkCost(changeCost(before, added), data.length, "background");
  const after = concatenate([kept, placed(added, place)]);
  checkGrowth(after, 0);
  return { mesh: after, added: wholeOf(added), isChange: true };
}

/** What the patch leaves of the state before. */
function keptOf(core: Core, record: StaticPatch, before: Mesh): Mesh {
  const faces = faceCount(before);
  if (record.runs === 0 && record.dropped.length === 0) return before;
  if (record.runs > faces + 1) throw new FormatError(`background: ${record.runs} runs over ${faces} faces`);
  const [dropped, used] = fillRuns(decodeIntegers(core, record.dropped, record.runs), faces);
  if (used !== record.runs || !dropped.includes(1)) throw new FormatError(`background: ${record.runs} runs over ${faces} faces`);
  return without(before, dropped);
}
