// Limits on the memory that decoding may take, in proportion to the bytes of a chunk. Beside format/budget.py.

import { FormatError } from "../errors.ts";
import { LIMITS } from "./layout.gen.ts";
import type { Mesh } from "../mesh.ts";

/** Faces and vertices of a mesh, at most, after its midpoint subdivisions. */
export function elementsOf({ faces, vertices }: Mesh, levels = 0): number {
  return ((faces.length + vertices.length) / 3) * 4 ** levels;
}

/** Cost allowed to a chunk of `size` bytes. */
export function allowance(size: number): number {
  return LIMITS.free + LIMITS.perByte * size;
}

/** A DRACO group of meshes of so many elements. */
export function dracoCost(elements: readonly number[]): number {
  const largest = elements.reduce((most, count) => Math.max(most, count), 0);
  const sum = elements.reduce((total, count) => total + count, 0);
  return LIMITS.frame * elements.length + LIMITS.shown * sum + LIMITS.element * largest;
}

/** A LAYERS group with this base mesh and as many levels as are decoded. */
export function layersCost(base: Mesh, levels: number, frames: number): number {
  const products = Math.floor((elementsOf(base) * frames ** 2) / 4);
  return elementsOf(base, levels) * (LIMITS.moving * frames + LIMITS.element) + products;
}

/** A LAPLACIAN group with this reference mesh. */
export function laplacianCost(reference: Mesh, levels: number, frames: number, components: number): number {
  const corners = new Float64Array(reference.vertices.length / 3);
  for (const vertex of reference.faces) corners[vertex] += 1;
  const pairs = corners.reduce((sum, count) => sum + count * count, 0);
  const numbers = 3 * frames * (1 + components);
  const growing = LIMITS.column * (frames + components) + LIMITS.solved + Math.floor(numbers / 12);
  return elementsOf(reference, levels) * growing + LIMITS.pair * pairs + LIMITS.number * numbers + LIMITS.frame * frames;
}

/** A change of the background. */
export function changeCost(before: Mesh, added: Mesh): number {
  return LIMITS.element * (elementsOf(before) + elementsOf(added));
}

/** A state of the background, and the cost and the bytes of the chunks that led to it. */
export interface Led {
  readonly mesh: Mesh;
  readonly cost: number;
  readonly size: number;
}

/** The state that a chunk of `size` bytes made of the one before. FormatError where all that led to it costs too much. */
export function led(before: Led | null, mesh: Mesh, size: number): Led {
  if (before === null) return { mesh, cost: 0, size };
  const after = { mesh, cost: before.cost + changeCost(before.mesh, mesh), size: before.size + size };
  const most = LIMITS.chain * allowance(after.size);
  if (after.cost > most) throw new FormatError(`background: ${after.size} bytes of states that cost ${after.cost} to decode`);
  return after;
}

/** Memory that the groups of one frame may take, which have `size` bytes together. */
export function together(size: number): number {
  return LIMITS.together + LIMITS.perByte * size;
}

/** FormatError where the groups of a file have more frames, of all tracks, than its bytes may. */
export function checkFrames(frames: number, size: number): void {
  const most = LIMITS.frames + LIMITS.framesPerByte * size;
  if (frames > most) throw new FormatError(`${frames} frames of all tracks in a file of ${size} bytes, over ${most}`);
}

/** FormatError where colours of so many vertices in so many frames, of each mesh, cost more than `size` bytes may. */
export function checkColors(meshes: readonly { readonly vertices: number; readonly frames: number }[], size: number): void {
  const largest = meshes.reduce((most, { vertices }) => Math.max(most, vertices), 0);
  const sum = meshes.reduce((total, { vertices, frames }) => total + vertices * frames, 0);
  const cost = LIMITS.painted * sum + LIMITS.painting * largest;
  if (cost > LIMITS.colors + LIMITS.perByte * size) throw new FormatError(`colours: ${size} bytes that cost ${cost} to decode`);
}

/** FormatError where a video of so many texels, of all pictures of a chunk or layer together, costs more than `size` bytes may. */
export function checkPictures(texels: number, size: number): void {
  const cost = LIMITS.texel * texels;
  if (cost > LIMITS.pictures + LIMITS.perByte * size) throw new FormatError(`pictures: ${size} bytes that cost ${cost} to decode`);
}

/** FormatError where decoding costs more than `size` bytes may. */
export function checkCost(cost: number, size: number, what: string): void {
  if (cost > allowance(size)) throw new FormatError(`${what}: ${size} bytes that cost ${cost} to decode, over ${allowance(size)}`);
}
