// Packed values made by hand, whose every position and normal is known.

import type { Box, PackedGroup, PackedStatic } from "@meshreel/player-core/types";
import { encodeNormal } from "../../test/octahedral.ts";
import type { Vector } from "../src/colors.ts";

export interface Surface {
  readonly positions: Vector[];
  readonly normals: Vector[];
  readonly faces: number[];
}

export interface MadeGroup {
  readonly packed: PackedGroup;
  /** Positions of frame t, by the vertices' numbers; those that only another frame has are null. */
  readonly positions: (Vector | null)[][];
}

/** A sphere of `rings` x 2 `rings` quads, counter-clockwise from outside. */
export function sphere(center: Vector, radius: number, rings: number): Surface {
  const surface: Surface = { positions: [], normals: [], faces: [] };
  const around = 2 * rings;
  for (let i = 0; i <= rings; i++) {
    for (let j = 0; j < around; j++) {
      const [theta, phi] = [(Math.PI * i) / rings, (2 * Math.PI * j) / around];
      const n: Vector = [Math.sin(theta) * Math.sin(phi), Math.cos(theta), Math.sin(theta) * Math.cos(phi)];
      surface.normals.push(n);
      surface.positions.push([center[0] + radius * n[0], center[1] + radius * n[1], center[2] + radius * n[2]]);
      if (i === rings) continue;
      const [a, b] = [i * around + j, i * around + ((j + 1) % around)];
      surface.faces.push(a, a + around, b, b, a + around, b + around);
    }
  }
  return surface;
}

/** A square that looks along +z. */
export function square(center: Vector, half: number): Surface {
  const corner = (x: number, y: number): Vector => [center[0] + half * x, center[1] + half * y, center[2]];
  const normal: Vector = [0, 0, 1];
  return {
    positions: [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)],
    normals: [normal, normal, normal, normal],
    faces: [0, 1, 2, 0, 2, 3],
  };
}

export interface GroupOptions {
  readonly track?: number;
  readonly firstFrame?: number;
  readonly frameCount?: number;
  readonly rings?: number;
  /** Where the sphere's center is in frame t of the group. */
  readonly center?: (t: number) => Vector;
  /** The frame, counted in the group, that alone has the square; -1 for none. */
  readonly squareFrame?: number;
  /** Whether it has colours of its own: those of `sphereColor` and SQUARE_COLOR. */
  readonly isColored?: boolean;
}

export const RADIUS = 0.3; // m
export const SQUARE: Vector = [0, 0.6, 0];
export const SQUARE_HALF = 0.2; // m
export const SQUARE_COLOR = [250, 3, 99] as const;
export const FLOOR_COLOR = [12, 134, 56] as const;

/** Bytes of the sphere in frame t of the group. */
export function sphereColor(t: number): readonly number[] {
  return [40 + 50 * t, 200, 17];
}

/** A group with a sphere that moves and, in one frame, a square above it. */
export function makeGroup(options: GroupOptions = {}): MadeGroup {
  const { track = 0, firstFrame = 0, frameCount = 4, rings = 16, squareFrame = 2 } = options;
  const center = options.center ?? ((t: number): Vector => [-0.6 + 0.4 * t, 0, 0]);
  const frames = Array.from({ length: frameCount }, (_, t) => sphere(center(t), RADIUS, rings));
  const lone = squareFrame < 0 ? null : square(SQUARE, SQUARE_HALF);
  const all = [...frames, ...(lone ? [lone] : [])];
  const box = boxAround(all.flatMap((surface) => surface.positions));
  const vertexCount = frames[0].positions.length;
  const texelCount = frameCount * vertexCount + (lone?.positions.length ?? 0);
  const textureWidth = 37; // odd, so that rows break anywhere
  const textureHeight = Math.ceil(texelCount / textureWidth);
  const texels = new Uint16Array(4 * textureWidth * textureHeight);
  texels.set(pack(all, box));
  const extra = Uint32Array.from(lone?.faces ?? [], (corner) => vertexCount + corner);
  const extraStarts = Uint32Array.from({ length: frameCount + 1 }, (_, t) => (t > squareFrame ? extra.length : 0));
  const shown = [...frames.map((_, t) => sphereColor(t)), SQUARE_COLOR];
  const colors = options.isColored ? new Uint8Array(texels.length) : null;
  colors?.set(all.flatMap(({ positions }, k) => positions.flatMap(() => [...shown[k], 255])));
  const packed: PackedGroup = {
    kind: "group", chunk: 1, track, firstFrame, frameCount, vertexCount, textureWidth, textureHeight, texels, colors, box, places: null,
    faces: Uint32Array.from(frames[0].faces), extra, extraStarts, splats: null, layers: 0, bytes: 1000, decodeMs: 1,
  };
  const positions = frames.map((frame, t) => [...frame.positions, ...(lone?.positions ?? []).map((p) => (t === squareFrame ? p : null))]);
  return { packed, positions };
}

/** A floor of `cells` x `cells` squares of half a metre below the sphere; normals look up. */
export function makeFloor(cells = 6, isColored = false): { packed: PackedStatic; positions: Vector[] } {
  const positions: Vector[] = [];
  const faces: number[] = [];
  for (let i = 0; i <= cells; i++) for (let j = 0; j <= cells; j++) positions.push([(i - cells / 2) / 2, -0.5, (j - cells / 2) / 2]);
  for (let i = 0; i < cells; i++) {
    for (let j = 0; j < cells; j++) {
      const [a, b] = [i * (cells + 1) + j, (i + 1) * (cells + 1) + j];
      faces.push(a, a + 1, b, b, a + 1, b + 1);
    }
  }
  const normals = positions.map((): Vector => [0, 1, 0]);
  const box = boxAround(positions);
  const texels = pack([{ positions, normals, faces }], box);
  const colors = isColored ? Uint8Array.from(positions.flatMap(() => [...FLOOR_COLOR, 255])) : null;
  const packed: PackedStatic = {
    kind: "static", chunk: 0, vertexCount: positions.length, texels, colors, box, places: null, faces: Uint32Array.from(faces), bytes: 500, decodeMs: 1,
  };
  return { packed, positions };
}

export function boxAround(positions: readonly Vector[]): Box {
  const along = (k: number): number[] => positions.map((position) => position[k]);
  const low = (k: number): number => along(k).reduce((a, b) => Math.min(a, b));
  const size = (k: number): number => along(k).reduce((a, b) => Math.max(a, b)) - low(k);
  return { minimum: [low(0), low(1), low(2)], size: [size(0), size(1), size(2)] };
}

function pack(surfaces: readonly Surface[], box: Box): Uint16Array {
  const place = (value: number, k: number): number => (box.size[k] > 0 ? Math.round(((value - box.minimum[k]) / box.size[k]) * 65535) : 0);
  return Uint16Array.from(
    surfaces.flatMap(({ positions, normals }) =>
      positions.flatMap(([x, y, z], v) => [place(x, 0), place(y, 1), place(z, 2), encodeNormal(normals[v])]),
    ),
  );
}
