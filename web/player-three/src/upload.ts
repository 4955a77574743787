// What the GPU holds of one packed value. Everything lies over the value's own arrays: nothing is copied, and a lost context can
// be filled again from them.

import { BufferAttribute, BufferGeometry, DataTexture, IntType, RGBAIntegerFormat, Sphere, UnsignedShortType, Vector3 } from "three";
import type { Box, Packed, PackedVertices } from "@meshreel/player-core/types";

const TEXEL_BYTES = 8;

/** Triangles of three corners each: with an index, and where edges are wanted without one, each corner an attribute. */
interface Triangles {
  readonly corners: Uint32Array;
  readonly indexed: BufferGeometry;
  unindexed: BufferGeometry | null;
}

export class Upload {
  readonly packed: Packed;
  /** The vertices; a background has them only while edges are drawn. */
  texture: DataTexture | null = null;
  readonly #sphere: Sphere;
  readonly #faces: Triangles;
  readonly #extra: Triangles | null = null;
  #hasEdges = false;

  constructor(packed: Packed) {
    this.packed = packed;
    this.#sphere = sphereAround(packed.box);
    this.#faces = this.#triangles(packed.faces);
    if (packed.kind === "static") {
      const texels = new BufferAttribute(packed.texels, 4);
      texels.gpuType = IntType;
      this.#faces.indexed.setAttribute("texel", texels);
    } else {
      this.texture = vertexTexture(packed, packed.textureWidth, packed.textureHeight);
      if (packed.extra.length > 0) this.#extra = this.#triangles(packed.extra);
    }
  }

  /** Bytes of its textures and buffers on the GPU. */
  get bytes(): number {
    const { packed } = this;
    const corners = packed.faces.byteLength + (packed.kind === "group" ? packed.extra.byteLength : 0);
    const attributes = packed.kind === "static" ? packed.texels.byteLength : 0;
    const texture = this.texture === null ? 0 : this.texture.image.width * this.texture.image.height * TEXEL_BYTES;
    return attributes + texture + corners * (this.#hasEdges ? 2 : 1);
  }

  /** Triangles of every frame, to be drawn with edges or without. */
  faces(edges: boolean): BufferGeometry {
    return this.#pick(this.#faces, edges);
  }

  /** Triangles of single frames; null where there are none. */
  extra(edges: boolean): BufferGeometry | null {
    return this.#extra && this.#pick(this.#extra, edges);
  }

  /** Frees what only edges need. */
  dropEdges(): void {
    if (!this.#hasEdges) return;
    this.#hasEdges = false;
    for (const triangles of this.#parts()) {
      triangles.unindexed?.dispose();
      triangles.unindexed = null;
    }
    if (this.packed.kind === "static") {
      this.texture?.dispose();
      this.texture = null;
    }
  }

  dispose(): void {
    this.dropEdges();
    for (const triangles of this.#parts()) triangles.indexed.dispose();
    this.texture?.dispose();
  }

  #parts(): readonly Triangles[] {
    return this.#extra ? [this.#faces, this.#extra] : [this.#faces];
  }

  #triangles(corners: Uint32Array): Triangles {
    const indexed = this.#geometry();
    indexed.setIndex(new BufferAttribute(corners, 1));
    indexed.setDrawRange(0, corners.length);
    return { corners, indexed, unindexed: null };
  }

  #pick(triangles: Triangles, edges: boolean): BufferGeometry {
    if (!edges) return triangles.indexed;
    if (!this.#hasEdges) this.#makeEdges();
    return triangles.unindexed!;
  }

  // WebGL lets no buffer be an index and an attribute too, so the corners are on the GPU a second time.
  #makeEdges(): void {
    for (const triangles of this.#parts()) {
      triangles.unindexed = this.#geometry();
      triangles.unindexed.setAttribute("corner", new BufferAttribute(triangles.corners, 1));
      triangles.unindexed.setDrawRange(0, triangles.corners.length);
    }
    this.texture ??= paddedTexture(this.packed);
    this.#hasEdges = true;
  }

  #geometry(): BufferGeometry {
    const geometry = new BufferGeometry();
    geometry.boundingSphere = this.#sphere; // three would look for it in an attribute that there is not
    return geometry;
  }
}

/** Around the whole box, and so around every frame and every blend of two. */
function sphereAround(box: Box): Sphere {
  const half = new Vector3(...box.size).multiplyScalar(0.5);
  return new Sphere(new Vector3(...box.minimum).add(half), half.length());
}

function vertexTexture(vertices: PackedVertices, width: number, height: number): DataTexture {
  const texture = new DataTexture(vertices.texels, width, height, RGBAIntegerFormat, UnsignedShortType);
  texture.internalFormat = "RGBA16UI";
  texture.needsUpdate = true;
  return texture;
}

const PADDED_WIDTH = 2048; // every WebGL 2 has textures of this width

/** A texture of vertices that come without padding; this one is a copy. */
function paddedTexture(vertices: PackedVertices): DataTexture {
  const height = Math.max(1, Math.ceil(vertices.texels.length / 4 / PADDED_WIDTH));
  const texels = new Uint16Array(4 * PADDED_WIDTH * height);
  texels.set(vertices.texels);
  return vertexTexture({ texels, box: vertices.box }, PADDED_WIDTH, height);
}
