// Materials: one set of uniforms for each part of the scene, one program for each way its vertices come.

import { DoubleSide, GLSL3, Matrix4, RawShaderMaterial } from "three";
import type { DataTexture, IUniform, Texture } from "three";
import { PLACE_SCALE } from "@meshreel/player-core/types";
import { EDGE_COLOR } from "./colors.ts";
import type { Vector } from "./colors.ts";
import { MODES } from "./modes.ts";
import { surfaceVertex, SURFACE_FRAGMENT } from "./shaders.ts";
import type { Feed } from "./shaders.ts";

/** Uniforms that all parts share. */
export interface Look {
  readonly mode: IUniform<number>;
  readonly flatNormals: IUniform<boolean>;
  readonly exposure: IUniform<number>;
  readonly up: IUniform<Vector>;
  readonly ground: IUniform<readonly [number, number]>; // its position along `up`, and 1 / the height of the recording
  readonly shadow: IUniform<Texture | null>; // on a room's floor
  readonly toFloor: IUniform<Matrix4>;
}

/** A floor without a shadow. */
export const NOWHERE: Matrix4 = new Matrix4().makeScale(0, 0, 0).setPosition(0, 1, 0);

export function makeLook(): Look {
  return { mode: { value: MODES.indexOf("shaded") }, flatNormals: { value: false }, exposure: { value: 1 }, up: { value: [0, 1, 0] }, ground: { value: [-1e6, 1] }, shadow: { value: null }, toFloor: { value: NOWHERE } };
}

/** Uniforms of a part: which vertices of which frames it shows. Names as in shaders.ts. */
export interface PartUniforms {
  readonly boxMinimum: IUniform<Vector>;
  readonly boxSize: IUniform<Vector>;
  readonly vertices: IUniform<DataTexture | null>;
  readonly colors: IUniform<DataTexture | null>;
  readonly hasColors: IUniform<boolean>;
  readonly image: IUniform<Texture | null>;
  readonly hasImage: IUniform<boolean>;
  readonly movingCount: IUniform<number>;
  readonly here: IUniform<number>;
  readonly next: IUniform<number>;
  readonly behind: IUniform<number>;
  readonly blend: IUniform<number>;
}

export function makeUniforms(): PartUniforms {
  return {
    boxMinimum: { value: [0, 0, 0] },
    boxSize: { value: [0, 0, 0] },
    vertices: { value: null },
    colors: { value: null },
    hasColors: { value: false },
    image: { value: null },
    hasImage: { value: false },
    movingCount: { value: 0 },
    here: { value: 0 },
    next: { value: 0 },
    behind: { value: 0 },
    blend: { value: 0 },
  };
}

export interface Paint {
  readonly clay: Vector;
  readonly color: Vector;
}

/** Extras drawn beside the surface; the first two need the feed `corner`. */
export interface Extras {
  readonly edges: boolean;
  readonly places: boolean; // of corners, in a texture
  readonly patches: boolean; // alone: splats are drawn in place of the rest
}

/** A material whose values are `uniforms`: changes of them take effect at once. */
export function surfaceMaterial(feed: Feed, { edges, places, patches }: Extras, look: Look, uniforms: PartUniforms, paint: Paint): RawShaderMaterial {
  return new RawShaderMaterial({
    name: `meshreel ${feed}`,
    glslVersion: GLSL3,
    vertexShader: surfaceVertex(feed),
    fragmentShader: SURFACE_FRAGMENT,
    defines: {
      NORMAL_MODE: MODES.indexOf("normal"),
      COLOR_MODE: MODES.indexOf("color"),
      TRACKS_MODE: MODES.indexOf("tracks"),
      ...(edges ? { EDGES: 1 } : {}),
      ...(places ? { PLACES: 1, PLACE_SCALE } : {}),
      ...(patches ? { PATCHES: 1 } : {}),
      ...(feed === "attribute" ? { FLOOR: 1 } : {}),
    },
    uniforms: {
      ...look,
      ...uniforms,
      clay: { value: paint.clay },
      color: { value: paint.color },
      edgeColor: { value: EDGE_COLOR },
    },
    side: DoubleSide,
  });
}

/** The materials of a part, by what is drawn: with edges or without, textured or not, all or patches alone. */
export class Materials {
  readonly #all: readonly RawShaderMaterial[];

  /** `feed`: of what has neither. */
  constructor(feed: Feed, look: Look, uniforms: PartUniforms, paint: Paint) {
    const extras = Array.from({ length: 8 }, (_, k): Extras => ({ edges: (k & 1) !== 0, places: (k & 2) !== 0, patches: (k & 4) !== 0 }));
    this.#all = extras.map((some) => surfaceMaterial(some.edges || some.places ? "corner" : feed, some, look, uniforms, paint));
  }

  of({ edges, places, patches }: Extras): RawShaderMaterial {
    return this.#all[(edges ? 1 : 0) + (places ? 2 : 0) + (patches ? 4 : 0)];
  }

  dispose(): void {
    for (const material of this.#all) material.dispose();
  }
}
