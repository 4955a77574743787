// Displacement fields of a LAPLACIAN group: KLT, Laplacian coordinates, quantisation. Beside coding/displacements.py.

import { FormatError } from "../errors.ts";
import { AnchorRule, DisplacementHead } from "../format/layout.gen.ts";
import type { Component } from "../format/layout.gen.ts";
import { vertexCount } from "../mesh.ts";
import type { Mesh } from "../mesh.ts";
import { unpack } from "../format/records.ts";
import { decodeWeights } from "../wasm/entropy.ts";
import { farthestAnchors, kltInverse, laplacianInverse } from "../wasm/laplacian.ts";
import type { LaplacianSystem } from "../wasm/laplacian.ts";
import type { Core } from "../wasm/memory.ts";
import { causalNeighbours, checkPlausible, decodeIntegers } from "./entropy.ts";
import { LEVELS, stepOf } from "./steps.ts";

const MOST_BITS = 30;
const MOST_NUMBERS = 2 ** 29;

/** Frames and components that the head of a payload claims. */
export function claimsOf(data: Uint8Array): [number, number] {
  const [head] = readHead(data);
  return [head.frames, head.components.length];
}

/** V x T x 3 displacements from at most `components` components; `data` may end behind these. */
export function decodeDisplacements(core: Core, data: Uint8Array, base: Mesh, components: number | null): Float64Array {
  const [head, offset] = readHead(data);
  const count = Math.min(components ?? head.components.length, head.components.length);
  const sizes = head.components.reduce((sum, part) => sum + part.anchorsSize + part.deltasSize, offset);
  if (components === null && sizes !== data.length) throw new FormatError(`displacements: ${data.length} bytes do not fit the sizes in their head; damaged or truncated`);
  const vertices = vertexCount(base);
  if (head.anchorCount > vertices) throw new FormatError(`displacements: ${head.anchorCount} anchors among ${vertices} vertices`);
  if (3 * head.frames * vertices > MOST_NUMBERS) throw new FormatError(`displacements: ${head.frames} frames of ${vertices} vertices exceed ${MOST_NUMBERS} numbers`);
  const anchors = anchorsOf(core, head, base);
  const system = { base, anchors, anchorWeight: head.anchorWeight };
  const deltas = deltasOf(core, head.components.slice(0, count), data, offset, system);
  const weights = laplacianInverse(core, system, deltas, count); // eq. 13
  const [mean, vectors] = readBasis(core, head, count);
  return kltInverse(core, weights, vertices, vectors, mean); // eq. 9
}

/** The head, checked, and the offset of the first stream. */
function readHead(data: Uint8Array): [DisplacementHead, number] {
  const [head, offset] = unpack(DisplacementHead, data);
  if (head.frames === 0 || head.components.length > 3 * head.frames) throw new FormatError(`displacements: ${head.components.length} components of ${head.frames} frames`);
  if (head.anchorWeight < 1 || head.meanBits > MOST_BITS) throw new FormatError(`displacements: anchor weight ${head.anchorWeight}, ${head.meanBits} bits for the mean`);
  for (const part of head.components) {
    if (part.basisBits > MOST_BITS || part.stepLevel >= LEVELS) throw new FormatError(`displacements: ${part.basisBits} bits, level ${part.stepLevel}`);
  }
  return [head, offset];
}

/** Deltas and below them the anchors' values: (V + anchors) rows of a number a component. */
function deltasOf(core: Core, components: readonly Component[], data: Uint8Array, offset: number, system: LaplacianSystem): Float64Array {
  const { base, anchors } = system;
  const [vertices, columns] = [vertexCount(base), components.length];
  const streams: Uint8Array[] = [];
  const fixed: Int32Array[] = [];
  components.forEach((part, c) => {
    const middle = offset + part.anchorsSize;
    const end = middle + part.deltasSize;
    if (end > data.length) throw new FormatError(`displacements: component ${c} ends at byte ${end} of ${data.length}; truncated`);
    fixed.push(decodeIntegers(core, data.subarray(offset, middle), anchors.length));
    streams.push(data.subarray(middle, end));
    offset = end;
  });
  streams.forEach((stream, c) => checkPlausible(vertices, stream.length, `weights, column ${c}`));
  const symbols = decodeWeights(core, streams, vertices, causalNeighbours(core, base.faces, vertices));
  if (typeof symbols === "number") throw new FormatError(`weights, column ${symbols}: ${streams[symbols].length} bytes are truncated or damaged`);
  const deltas = new Float64Array((vertices + anchors.length) * columns);
  components.forEach((part, c) => {
    const step = stepOf(part.stepLevel);
    for (let v = 0; v < vertices; v++) deltas[v * columns + c] = symbols[c * vertices + v] * step;
    for (let a = 0; a < anchors.length; a++) deltas[(vertices + a) * columns + c] = fixed[c][a] * step;
  });
  return deltas;
}

function readBasis(core: Core, head: DisplacementHead, count: number): [Float64Array, Float64Array] {
  const width = 3 * head.frames;
  const values = decodeIntegers(core, head.basis, width * (1 + head.components.length));
  const mean = Float64Array.from(values.subarray(0, width), (value) => value * 2 ** -head.meanBits);
  const vectors = new Float64Array(count * width);
  for (let c = 0; c < count; c++) {
    const scale = 2 ** -head.components[c].basisBits;
    for (let k = 0; k < width; k++) vectors[c * width + k] = values[(1 + c) * width + k] * scale;
  }
  return [mean, vectors];
}

/** Ascending anchor vertices, at least one for each connected component of faces. */
function anchorsOf(core: Core, head: DisplacementHead, base: Mesh): Int32Array {
  const vertices = vertexCount(base);
  if (head.anchorRule === AnchorRule.FARTHEST) return farthestAnchors(core, base.faces, vertices, head.anchorCount);
  const roots = componentsOf(base.faces, vertices);
  const chosen = new Uint8Array(vertices);
  const served = new Uint8Array(vertices); // by root
  const used = new Uint8Array(vertices);
  for (const vertex of base.faces) used[vertex] = 1;
  for (let k = 0; k < head.anchorCount; k++) {
    const vertex = Number((BigInt(k) * BigInt(vertices)) / BigInt(head.anchorCount));
    chosen[vertex] = served[roots[vertex]] = 1;
  }
  for (let v = 0; v < vertices; v++) if (roots[v] === v && !served[v]) chosen[v] = 1;
  const anchors: number[] = [];
  for (let v = 0; v < vertices; v++) if (chosen[v] && used[v]) anchors.push(v);
  return Int32Array.from(anchors);
}

/** For each vertex the first one of its connected component. */
function componentsOf(faces: Int32Array, vertices: number): Int32Array {
  const roots = Int32Array.from({ length: vertices }, (_, v) => v);
  const find = (v: number): number => {
    while (roots[v] !== v) v = roots[v] = roots[roots[v]];
    return v;
  };
  for (let f = 0; f < faces.length; f += 3) {
    for (let k = 1; k < 3; k++) {
      const [a, b] = [find(faces[f]), find(faces[f + k])];
      roots[Math.max(a, b)] = Math.min(a, b);
    }
  }
  return roots.map((_, v) => find(v));
}
