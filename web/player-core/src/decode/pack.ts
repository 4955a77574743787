// Decoded groups and backgrounds as the GPU takes them; what types.ts says of PackedGroup and PackedStatic.

import { frameOf } from "./decoded.ts";
import type { DecodedGroup, GroupColors } from "./decoded.ts";
import { FormatError } from "../errors.ts";
import { faceCount, vertexCount } from "../mesh.ts";
import type { Mesh } from "../mesh.ts";
import { NO_PLACE, PLACE_SCALE } from "../types.ts";
import type { Box, PackedGroup, PackedPlaces, PackedStatic } from "../types.ts";
import type { Core } from "../wasm/memory.ts";
import { growBox, noBounds, packVertices } from "../wasm/packing.ts";
import type { Bounds } from "../wasm/packing.ts";

const TEXTURE_WIDTH = 2048; // that every WebGL 2 has
const MOST_ROWS = 16384; // that nearly every one has; 33 million vertices

/** A texture's size, and the places of all corners of finest faces in it, in texels (`finerPlaces`). */
export interface FineAtlas {
  readonly width: number;
  readonly height: number;
  readonly places: Float32Array;
}

/** A group as it is in itself, wherever it comes from. */
export type GroupShape = Omit<PackedGroup, "kind" | "chunk" | "track" | "firstFrame" | "splats" | "layers" | "bytes" | "decodeMs">;

/** `atlas`: of the shared faces, where they have textures. */
export function packGroup(core: Core, group: DecodedGroup, colors: GroupColors | null, atlas: FineAtlas | null): GroupShape {
  const { frameCount, vertexCount: shared } = group;
  const frames = Array.from({ length: frameCount }, (_, t) => frameOf(group, t));
  const alone = frames.map((mesh) => vertexCount(mesh) - shared); // vertices that a frame has for itself
  const total = frames.reduce((sum, mesh) => sum + vertexCount(mesh), 0);
  const rows = Math.max(1, Math.ceil(total / TEXTURE_WIDTH));
  if (rows > MOST_ROWS) throw new FormatError(`a group of ${total} vertices in all frames: over ${MOST_ROWS * TEXTURE_WIDTH}`);
  const bounds = frames.reduce((box, mesh) => growBox(core, mesh.vertices, box), noBounds());
  const texels = new Uint16Array(4 * TEXTURE_WIDTH * rows);
  let behind = frameCount * shared;
  frames.forEach((mesh, t) => {
    const packed = packVertices(core, mesh, bounds);
    texels.set(packed.subarray(0, 4 * shared), 4 * t * shared);
    texels.set(packed.subarray(4 * shared), 4 * behind);
    behind += alone[t];
  });
  const box = boxOf(bounds);
  const packed = { texels, colors: colors && colorTexels(colors, TEXTURE_WIDTH * rows) };
  return { frameCount, vertexCount: shared, textureWidth: TEXTURE_WIDTH, textureHeight: rows, ...corners(group, atlas), ...packed, box };
}

/** `atlas`: of all faces, where they have textures. */
export function packStatic(core: Core, mesh: Mesh, atlas: FineAtlas | null): Omit<PackedStatic, "kind" | "chunk" | "bytes" | "decodeMs"> {
  const bounds = growBox(core, mesh.vertices, noBounds());
  const texels = packVertices(core, mesh, bounds);
  const colors = mesh.colors ? colorTexels(mesh.colors, vertexCount(mesh)) : null;
  const faces = Uint32Array.from(mesh.faces);
  const places = atlas && placesOf(atlas, Array.from({ length: faceCount(mesh) }, (_, face) => face), []);
  return { texels, colors, places, box: boxOf(bounds), vertexCount: vertexCount(mesh), faces };
}

/** Four bytes a colour, and room for `count`: their order is that of a group's texels. */
function colorTexels(colors: Uint8Array, count: number): Uint8Array {
  const texels = new Uint8Array(4 * count);
  for (let [from, to] = [0, 0]; from < colors.length; from += 3, to += 4) {
    texels[to] = colors[from];
    texels[to + 1] = colors[from + 1];
    texels[to + 2] = colors[from + 2];
    texels[to + 3] = 255;
  }
  return texels;
}

/** The faces of all frames, and those of single ones: kept there though not everywhere, or of the frame's own mesh. */
function corners(group: DecodedGroup, atlas: FineAtlas | null): Pick<PackedGroup, "faces" | "extra" | "extraStarts" | "places"> {
  const { frameCount, faces, dropped, patches, vertexCount: shared } = group;
  const count = faces.length / 3;
  const changing: number[] = [];
  const common: number[] = [];
  for (let face = 0; face < count; face++) (isEverDropped(dropped, face, count) ? changing : common).push(face);
  const extra: number[] = [];
  const extraFaces: number[] = []; // -1: of a patch
  const extraStarts = new Uint32Array(frameCount + 1);
  let first = shared;
  for (let t = 0; t < frameCount; t++) {
    for (const face of changing) {
      if (dropped![t * count + face]) continue;
      extra.push(faces[3 * face], faces[3 * face + 1], faces[3 * face + 2]);
      extraFaces.push(face);
    }
    const patch = patches?.[t];
    if (patch) {
      for (const corner of patch.faces) extra.push(first + corner);
      for (let face = 0; face < faceCount(patch); face++) extraFaces.push(-1);
      first += vertexCount(patch);
    }
    extraStarts[t + 1] = extra.length;
  }
  const places = atlas && placesOf(atlas, common, extraFaces);
  return { faces: cornersOf(faces, common), extra: Uint32Array.from(extra), extraStarts, places };
}

/** Places of the corners of some faces, one behind the other; a face -1 has none. */
function placesOf(atlas: FineAtlas, faces: readonly number[], extra: readonly number[]): PackedPlaces {
  const { width, height, places } = atlas;
  const packed = (some: readonly number[]): Uint16Array => {
    const found = new Uint16Array(6 * some.length).fill(NO_PLACE);
    some.forEach((face, f) => {
      if (face < 0 || Number.isNaN(places[6 * face])) return;
      for (let k = 0; k < 6; k++) found[6 * f + k] = Math.round((PLACE_SCALE * places[6 * face + k]) / (k % 2 === 0 ? width : height));
    });
    return found;
  };
  return { width, height, faces: packed(faces), extra: packed(extra) };
}

function isEverDropped(dropped: Uint8Array | null, face: number, count: number): boolean {
  if (dropped === null) return false;
  for (let at = face; at < dropped.length; at += count) if (dropped[at]) return true;
  return false;
}

function cornersOf(faces: Int32Array, kept: readonly number[]): Uint32Array {
  const corners = new Uint32Array(3 * kept.length);
  kept.forEach((face, f) => {
    for (let k = 0; k < 3; k++) corners[3 * f + k] = faces[3 * face + k];
  });
  return corners;
}

/** An empty box where there is no vertex. */
function boxOf(bounds: Bounds): Box {
  const low = [0, 1, 2].map((k) => (Number.isFinite(bounds[k]) ? bounds[k] : 0));
  const size = low.map((value, k) => Math.max(0, Number.isFinite(bounds[3 + k]) ? bounds[3 + k] - value : 0));
  return { minimum: low as unknown as Box["minimum"], size: size as unknown as Box["size"] };
}
