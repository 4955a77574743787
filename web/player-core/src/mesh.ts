// A triangle mesh, and what decoding does with one. Beside types.py and geometry/topology.py.

import { FormatError } from "./errors.ts";

/** Legal without faces and without vertices (an empty frame). */
export interface Mesh {
  readonly vertices: Float64Array; // x, y, z of each
  readonly faces: Int32Array; // three vertices of each, counter-clockwise from outside
  readonly colors?: Uint8Array | undefined; // red, green and blue of each vertex, sRGB
}

const GREY = 128; // red, green and blue of vertices without colours beside some with colours

export const EMPTY: Mesh = { vertices: new Float64Array(0), faces: new Int32Array(0) };

/** Map from normalised coordinates to metres: origin + scale * coordinate. */
export interface Placement {
  readonly scale: number; // m
  readonly origin: readonly number[]; // m, three
}

export function vertexCount(mesh: Mesh): number {
  return mesh.vertices.length / 3;
}

export function faceCount(mesh: Mesh): number {
  return mesh.faces.length / 3;
}

export function placed(mesh: Mesh, place: Placement): Mesh {
  const vertices = mesh.vertices.map((value, k) => place.origin[k % 3] + place.scale * value);
  return { ...mesh, vertices };
}

/** The vertices and faces of all meshes, one behind the other. Where some vertices have colours, those of the others are grey. */
export function concatenate(meshes: readonly Mesh[]): Mesh {
  const sizes = meshes.reduce((sum, mesh) => [sum[0] + mesh.vertices.length, sum[1] + mesh.faces.length], [0, 0]);
  const vertices = new Float64Array(sizes[0]);
  const faces = new Int32Array(sizes[1]);
  const isColored = meshes.some((mesh) => mesh.colors !== undefined && mesh.vertices.length > 0);
  const colors = isColored ? new Uint8Array(sizes[0]).fill(GREY) : undefined;
  let [v, f] = [0, 0];
  for (const mesh of meshes) {
    vertices.set(mesh.vertices, v);
    if (mesh.colors) colors?.set(mesh.colors, v);
    for (let k = 0; k < mesh.faces.length; k++) faces[f + k] = mesh.faces[k] + v / 3;
    v += mesh.vertices.length;
    f += mesh.faces.length;
  }
  return { vertices, faces, colors };
}

/** The faces that are not dropped, and the vertices that they use, in their order. */
export function without(mesh: Mesh, dropped: Uint8Array): Mesh {
  const place = new Int32Array(vertexCount(mesh)).fill(-1);
  const kept: number[] = [];
  dropped.forEach((gone, face) => {
    if (!gone) kept.push(face);
  });
  for (const face of kept) for (let k = 0; k < 3; k++) place[mesh.faces[3 * face + k]] = 0;
  let count = 0;
  for (let v = 0; v < place.length; v++) if (place[v] === 0) place[v] = count++;
  const vertices = new Float64Array(3 * count);
  const colors = mesh.colors && new Uint8Array(3 * count);
  for (let v = 0; v < place.length; v++) {
    if (place[v] < 0) continue;
    vertices.set(mesh.vertices.subarray(3 * v, 3 * v + 3), 3 * place[v]);
    colors?.set(mesh.colors!.subarray(3 * v, 3 * v + 3), 3 * place[v]);
  }
  const faces = new Int32Array(3 * kept.length);
  kept.forEach((face, f) => {
    for (let k = 0; k < 3; k++) faces[3 * f + k] = place[mesh.faces[3 * face + k]];
  });
  return { vertices, faces, colors };
}

/** Refuses faces that name vertices which are not there. */
export function checkFaces(faces: Int32Array, vertices: number, what: string): void {
  for (let k = 0; k < faces.length; k++) {
    if (faces[k] < 0 || faces[k] >= vertices) throw new FormatError(`${what}: a face names vertex ${faces[k]} of ${vertices}`);
  }
}
