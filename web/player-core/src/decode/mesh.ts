// Meshes out of Draco bytes, on a lattice that all meshes of a stream share. Beside coding/mesh.py.

import type { Decoder, DecoderModule, Mesh as DracoMesh } from "draco3d";

import { FormatError } from "../errors.ts";
import { EMPTY, checkFaces, faceCount, vertexCount } from "../mesh.ts";
import type { Mesh } from "../mesh.ts";
import { checkClaims } from "../wasm/draco.ts";
import { subdivide } from "../wasm/layers.ts";
import { CoreStopped } from "../wasm/memory.ts";
import type { Core } from "../wasm/memory.ts";

const MAX_FACES = 64_000_000; // as in coding/mesh.py

/** The mesh of Draco bytes, its vertices exact multiples of `step`. FormatError where the bytes are damaged. */
export function decodeMesh(core: Core, draco: DecoderModule, data: Uint8Array, step: number): Mesh {
  if (data.length === 0) return EMPTY;
  checkClaims(core, [data]);
  const what = `damaged Draco data (${data.length} bytes)`;
  const mesh = decodeDraco(draco, data, what);
  const vertices = mesh.vertices.map((value) => roundHalfEven(value / step) * step);
  if (!vertices.every(Number.isFinite)) throw new FormatError(`${what}: positions are not finite`);
  checkFaces(mesh.faces, vertexCount(mesh), what);
  return { vertices, faces: mesh.faces };
}

/** To the nearest integer, halves to the even one, as IEEE 754 has it. */
export function roundHalfEven(value: number): number {
  const below = Math.floor(value);
  const rest = value - below;
  if (rest !== 0.5) return rest < 0.5 ? below : below + 1;
  return below % 2 === 0 ? below : below + 1;
}

function decodeDraco(draco: DecoderModule, data: Uint8Array, what: string): Mesh {
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  const buffer = new draco.DecoderBuffer();
  try {
    buffer.Init(data as unknown as Int8Array, data.length);
    if (decoder.GetEncodedGeometryType(buffer) !== draco.TRIANGULAR_MESH) throw new FormatError(`${what}: no triangle mesh`);
    const status = decoder.DecodeBufferToMesh(buffer, mesh);
    if (!status.ok()) throw new FormatError(`${what}: ${status.error_msg()}`);
    return { vertices: positionsOf(draco, decoder, mesh, what), faces: facesOf(draco, decoder, mesh) };
  } finally {
    draco.destroy(buffer);
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

function positionsOf(draco: DecoderModule, decoder: Decoder, mesh: DracoMesh, what: string): Float64Array {
  const id = decoder.GetAttributeId(mesh, draco.POSITION);
  if (id < 0) throw new FormatError(`${what}: no positions`);
  const attribute = decoder.GetAttribute(mesh, id);
  const size = 3 * mesh.num_points();
  if (attribute.num_components() !== 3) throw new FormatError(`${what}: positions of ${attribute.num_components()} numbers`);
  const place = allocated(draco, 4 * size);
  try {
    decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco.DT_FLOAT32, 4 * size, place);
    return Float64Array.from(new Float32Array(draco.HEAPF32.buffer, place, size));
  } finally {
    draco._free(place);
  }
}

function facesOf(draco: DecoderModule, decoder: Decoder, mesh: DracoMesh): Int32Array {
  const size = 3 * mesh.num_faces();
  const place = allocated(draco, 4 * size);
  try {
    decoder.GetTrianglesUInt32Array(mesh, 4 * size, place);
    return new Int32Array(draco.HEAPF32.buffer, place, size).slice();
  } finally {
    draco._free(place);
  }
}

/** Memory of Draco's. Throws CoreStopped where there is none: it would write over its own. */
function allocated(draco: DecoderModule, size: number): number {
  const place = draco._malloc(size);
  if (place === 0) throw new CoreStopped(`Draco has no memory for ${size} bytes`);
  return place;
}

/** FormatError where subdivision makes an absurd mesh, or frames. */
export function checkGrowth(mesh: Mesh, levels: number, frames = 1): void {
  if (frames * Math.max(faceCount(mesh) * 4 ** levels, vertexCount(mesh)) > MAX_FACES) {
    const told = `${faceCount(mesh)} faces of ${vertexCount(mesh)} vertices, subdivided ${levels} times, in ${frames} frames`;
    throw new FormatError(`${told}: over ${MAX_FACES}`);
  }
}

/** FormatError where a lattice's spacing is not above 0. */
export function checkStep(step: number): void {
  if (!(step > 0)) throw new FormatError(`lattice spacing ${step} is not above 0`);
}

/** The mesh with each triangle cut in four at its edge midpoints, `levels` times. */
export function subdivideMidpoint(core: Core, mesh: Mesh, levels: number): Mesh {
  for (let count = 0; count < levels; count++) {
    const { edges, faces } = subdivide(core, mesh.faces, vertexCount(mesh));
    const old = mesh.vertices.length;
    const vertices = new Float64Array(old + (3 * edges.length) / 2);
    vertices.set(mesh.vertices);
    for (let e = 0; e < edges.length / 2; e++) {
      for (let k = 0; k < 3; k++) vertices[old + 3 * e + k] = (vertices[3 * edges[2 * e] + k] + vertices[3 * edges[2 * e + 1] + k]) / 2;
    }
    mesh = { vertices, faces };
  }
  return mesh;
}
