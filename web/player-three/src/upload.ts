// GPU buffers and textures of one packed value. Everything lies over the value's own arrays: nothing is copied, and a lost context can
// be filled again from them.

import { BufferAttribute, BufferGeometry, DataTexture, IntType, RGBAFormat, RGBAIntegerFormat, Sphere, UnsignedByteType, UnsignedIntType, UnsignedShortType, Vector3 } from "three";
import { SPLATS_WIDTH } from "@meshreel/player-core/types";
import type { Box, Packed, PackedStatic } from "@meshreel/player-core/types";

const TEXEL_BYTES = 8;
const COLOR_BYTES = 4; // of a texel
const SPLATS_BYTES = 16; // as well

/** Triangles of three corners each: with an index, and where edges or textures are wanted without one, each corner an attribute. */
interface Triangles {
  readonly corners: Uint32Array;
  readonly places: Uint16Array | null; // of each corner, in a texture
  readonly indexed: BufferGeometry;
  unindexed: BufferGeometry | null;
}

export class Upload {
  readonly packed: Packed;
  /** The vertices; a background has them only while its corners are drawn each for itself. */
  texture: DataTexture | null = null;
  /** Their colours, texel for texel; null where there are none. */
  colors: DataTexture | null = null;
  /** Splats, and which frames lack them; null where there are none. */
  readonly splats: DataTexture | null = null;
  readonly #sphere: Sphere;
  readonly #faces: Triangles;
  readonly #extra: Triangles | null = null;
  #hasCorners = false;

  constructor(packed: Packed) {
    this.packed = packed;
    this.#sphere = sphereAround(packed.box);
    this.#faces = this.#triangles(packed.faces, packed.places?.faces ?? null);
    if (packed.kind === "static") {
      const texels = new BufferAttribute(packed.texels, 4);
      texels.gpuType = IntType;
      this.#faces.indexed.setAttribute("texel", texels);
      if (packed.colors !== null) this.#faces.indexed.setAttribute("rgba", new BufferAttribute(packed.colors, 4, true));
    } else {
      this.#setTextures(packed, packed.textureWidth, packed.textureHeight);
      if (packed.splats !== null) this.splats = splatsTexture(packed.splats.words);
      if (packed.extra.length > 0) this.#extra = this.#triangles(packed.extra, packed.places?.extra ?? null);
    }
  }

  /** Bytes of its textures and buffers on the GPU. */
  get bytes(): number {
    const { packed } = this;
    const corners = packed.faces.byteLength + (packed.kind === "group" ? packed.extra.byteLength : 0);
    const attributes = packed.kind === "static" ? packed.texels.byteLength + (packed.colors?.byteLength ?? 0) : 0;
    const textures = texelsOf(this.texture) * TEXEL_BYTES + texelsOf(this.colors) * COLOR_BYTES + texelsOf(this.splats) * SPLATS_BYTES;
    const places = (packed.places?.faces.byteLength ?? 0) + (packed.places?.extra.byteLength ?? 0);
    if (this.isTextured) return attributes + textures + corners + places;
    return attributes + textures + corners * (this.#hasCorners ? 2 : 1);
  }

  /** True if it has places in a texture: then each corner is drawn separately, with edges or without. */
  get isTextured(): boolean {
    return this.packed.places !== null;
  }

  /** Triangles as they lie in the file, with an index: for what is not drawn, as positions that are read back. */
  get indexed(): readonly BufferGeometry[] {
    return this.#parts().map(({ indexed }) => indexed);
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
    if (!this.isTextured) this.#dropCorners();
  }

  dispose(): void {
    this.#dropCorners();
    for (const triangles of this.#parts()) triangles.indexed.dispose();
    this.#dropTextures();
    this.splats?.dispose();
  }

  #dropCorners(): void {
    if (!this.#hasCorners) return;
    this.#hasCorners = false;
    for (const triangles of this.#parts()) {
      triangles.unindexed?.dispose();
      triangles.unindexed = null;
    }
    if (this.packed.kind === "static") this.#dropTextures();
  }

  #parts(): readonly Triangles[] {
    return this.#extra ? [this.#faces, this.#extra] : [this.#faces];
  }

  #triangles(corners: Uint32Array, places: Uint16Array | null): Triangles {
    const indexed = this.#geometry();
    indexed.setIndex(new BufferAttribute(corners, 1));
    indexed.setDrawRange(0, corners.length);
    return { corners, places, indexed, unindexed: null };
  }

  #pick(triangles: Triangles, edges: boolean): BufferGeometry {
    if (!edges && !this.isTextured) return triangles.indexed;
    if (!this.#hasCorners) this.#makeCorners();
    return triangles.unindexed!;
  }

  // WebGL lets no buffer be an index and an attribute too, so the corners are on the GPU a second time.
  #makeCorners(): void {
    for (const triangles of this.#parts()) {
      triangles.unindexed = this.#geometry();
      triangles.unindexed.setAttribute("corner", new BufferAttribute(triangles.corners, 1));
      if (triangles.places !== null) triangles.unindexed.setAttribute("place", new BufferAttribute(triangles.places, 2));
      triangles.unindexed.setDrawRange(0, triangles.corners.length);
    }
    if (this.packed.kind === "static") this.#setTextures(padded(this.packed), PADDED_WIDTH, paddedHeight(this.packed));
    this.#hasCorners = true;
  }

  #setTextures({ texels, colors }: Texels, width: number, height: number): void {
    this.texture = vertexTexture(texels, width, height);
    this.colors = colors && colorTexture(colors, width, height);
  }

  #dropTextures(): void {
    this.texture?.dispose();
    this.colors?.dispose();
    this.texture = this.colors = null;
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

type Texels = Pick<Packed, "texels" | "colors">;

function vertexTexture(texels: Uint16Array, width: number, height: number): DataTexture {
  const texture = new DataTexture(texels, width, height, RGBAIntegerFormat, UnsignedShortType);
  texture.internalFormat = "RGBA16UI";
  texture.needsUpdate = true;
  return texture;
}

/** Bytes as they are: the screen's colours (sRGB), like all others here. */
function colorTexture(colors: Uint8Array, width: number, height: number): DataTexture {
  const texture = new DataTexture(colors, width, height, RGBAFormat, UnsignedByteType);
  texture.needsUpdate = true;
  return texture;
}

function splatsTexture(words: Uint32Array): DataTexture {
  const texture = new DataTexture(words, SPLATS_WIDTH, words.length / 4 / SPLATS_WIDTH, RGBAIntegerFormat, UnsignedIntType);
  texture.internalFormat = "RGBA32UI";
  texture.needsUpdate = true;
  return texture;
}

function texelsOf(texture: DataTexture | null): number {
  return texture === null ? 0 : texture.image.width * texture.image.height;
}

const PADDED_WIDTH = 2048; // every WebGL 2 has textures of this width

function paddedHeight({ texels }: PackedStatic): number {
  return Math.max(1, Math.ceil(texels.length / 4 / PADDED_WIDTH));
}

/** Copies of a background's vertices and colours that fill a texture. */
function padded(background: PackedStatic): Texels {
  const room = 4 * PADDED_WIDTH * paddedHeight(background);
  const texels = new Uint16Array(room);
  texels.set(background.texels);
  const colors = background.colors && new Uint8Array(room);
  colors?.set(background.colors!);
  return { texels, colors };
}
