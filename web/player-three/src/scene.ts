// The scene of a recording: takes packed values ahead of time, shows any of them with a few uniforms.

import { Group } from "three";
import type { Matrix4, Texture, WebGLRenderer } from "three";
import { SPLATS_WIDTH } from "@meshreel/player-core/types";
import type { Packed, Shown, TextureImage } from "@meshreel/player-core/types";
import { BACKGROUND_CLAY, BACKGROUND_COLOR, trackClay, trackColor } from "./colors.ts";
import { makeLook, NOWHERE } from "./materials.ts";
import { MODES } from "./modes.ts";
import type { Mode } from "./modes.ts";
import { Part } from "./part.ts";
import { triangleCount } from "./ranges.ts";
import { Sorter } from "./sorter.ts";
import { Upload } from "./upload.ts";
import { Warmer } from "./warmer.ts";

/**
 * A recording in a three.js scene, in the recording's own space. Call `prepare` when a value arrives, `show` once a picture,
 * `release` when a value will not be shown again soon, `dispose` at the end. The arrays of prepared values must stay as they are:
 * a lost context is filled from them again.
 */
export class ReelScene extends Group {
  readonly #look = makeLook();
  readonly #uploads = new Map<Packed, Upload>();
  readonly #tracks: Part[] = [];
  readonly #background = new Part("attribute", this.#look, { clay: BACKGROUND_CLAY, color: BACKGROUND_COLOR });
  readonly #warmer = new Warmer(this.#look);
  #renderer: WebGLRenderer | null = null;
  readonly #sorter: Sorter;
  #mode: Mode = "shaded";
  #triangles = 0;

  /** `sorter` orders splats; without one that has a worker the page does, which takes it some milliseconds a picture. It is not disposed of. */
  constructor(sorter = new Sorter(null)) {
    super();
    this.#sorter = sorter;
    this.#background.renderOrder = 1; // most of it is hidden behind what moves
    this.add(this.#background);
  }

  /** Bytes of textures and buffers that it has on the GPU, without those of what it is drawn into. */
  get gpuBytes(): number {
    let bytes = 0;
    for (const upload of this.#uploads.values()) bytes += upload.bytes;
    for (const part of this.#parts()) bytes += part.ownBytes;
    return bytes;
  }

  /** Triangles of the last picture given to `show`; a splat is one. */
  get triangles(): number {
    return this.#triangles;
  }

  /** Splats of the last picture given to `show`, of each track. */
  get splats(): readonly number[] {
    return this.#tracks.map(({ splatCount }) => splatCount);
  }

  /** Appearance of surfaces, from the next `show` on. */
  get mode(): Mode {
    return this.#mode;
  }

  set mode(mode: Mode) {
    if (mode === this.mode) return;
    this.#mode = mode;
    this.#look.mode.value = MODES.indexOf(mode === "splats" ? "color" : mode);
    for (const part of this.#parts()) {
      part.edges = this.#edges;
      part.withSplats = mode === "splats";
    }
    if (!this.#edges) for (const upload of this.#uploads.values()) upload.dropEdges();
  }

  /** Brightness of the light, 1 as usual. */
  get exposure(): number {
    return this.#look.exposure.value;
  }

  set exposure(exposure: number) {
    this.#look.exposure.value = exposure;
  }

  /** One normal a triangle instead of one a vertex. */
  get flat(): boolean {
    return this.#look.flatNormals.value;
  }

  set flat(flat: boolean) {
    this.#look.flatNormals.value = flat;
  }

  /** Stands the recording up: turned by a rotation, then the lowest of it at `bottom`, `height` below the highest. */
  stand(turned: Matrix4, bottom: number, height: number): void {
    this.quaternion.setFromRotationMatrix(turned);
    this.updateMatrix();
    const row = turned.elements;
    this.#look.up.value = [row[1], row[5], row[9]]; // up in the recording's axes
    this.#look.ground.value = [bottom, 1 / (height || 1)];
  }

  /** Has `draw` draw how close the surfaces of what moves are to an eye, as alpha. */
  cast(draw: () => void): void {
    const [{ value }, { visible }] = [this.#look.mode, this.#background];
    this.#look.mode.value = -1;
    this.#background.visible = false;
    draw();
    this.#look.mode.value = value;
    this.#background.visible = visible;
  }

  /** Darkens the floor of a room that has no colours by a picture of a shadow, in a place; null for none. */
  darken(shadow: Texture | null, place: Matrix4 = NOWHERE): void {
    this.#look.shadow.value = shadow;
    this.#look.toFloor.value = place;
  }

  /** Uploads a value's vertices and triangles now, so that showing it later costs nothing. RangeError where the GPU cannot hold it. */
  prepare(packed: Packed, renderer: WebGLRenderer): Upload {
    this.#listen(renderer);
    checkSize(packed, renderer);
    const upload = this.#uploadOf(packed);
    this.#warmer.warm(upload, this.#mode, renderer);
    return upload;
  }

  /** Once a picture: what to draw. Values that were not prepared are uploaded as they are drawn. */
  show(shown: Shown): void {
    this.#triangles = 0;
    while (this.#tracks.length < shown.groups.length) this.#addTrack();
    for (let track = 0; track < this.#tracks.length; track++) {
      const frame = shown.frames[track] ?? shown.frame;
      this.#showPart(this.#tracks[track], shown.groups[track] ?? null, frame, frame === shown.frame ? shown.blend : 0, shown.images[track] ?? null);
    }
    this.#showPart(this.#background, shown.background, shown.frame, 0, shown.backgroundImage);
  }

  /** Frees what the GPU holds of a value. Its arrays are no longer referred to. */
  release(packed: Packed): void {
    const upload = this.#uploads.get(packed);
    if (upload === undefined) return;
    for (const part of this.#parts()) if (part.upload === upload) part.hide();
    this.#uploads.delete(packed);
    upload.dispose();
  }

  override dispose(): void {
    super.dispose();
    for (const packed of [...this.#uploads.keys()]) this.release(packed);
    for (const part of this.#parts()) part.dispose();
    this.#warmer.dispose();
    this.#renderer?.domElement.removeEventListener("webglcontextrestored", this.#refill);
    this.#renderer = null;
  }

  get #edges(): boolean {
    return this.mode === "wireframe";
  }

  #parts(): readonly Part[] {
    return [...this.#tracks, this.#background];
  }

  #showPart(part: Part, packed: Packed | null, frame: number, blend: number, image: TextureImage | null): void {
    if (packed === null) {
      part.hide();
      return;
    }
    part.show(this.#uploadOf(packed), frame, blend, image);
    this.#triangles += part.splatCount > 0 ? part.splatCount : triangleCount(packed, frame);
  }

  #uploadOf(packed: Packed): Upload {
    let upload = this.#uploads.get(packed);
    if (upload === undefined) this.#uploads.set(packed, (upload = new Upload(packed)));
    return upload;
  }

  #addTrack(): void {
    const track = this.#tracks.length;
    const part = new Part("texture", this.#look, { clay: trackClay(track), color: trackColor(track) }, this.#sorter);
    part.edges = this.#edges;
    part.withSplats = this.#mode === "splats";
    this.#tracks.push(part);
    this.add(part);
  }

  #listen(renderer: WebGLRenderer): void {
    if (renderer === this.#renderer) return;
    this.#renderer?.domElement.removeEventListener("webglcontextrestored", this.#refill);
    this.#renderer = renderer;
    renderer.domElement.addEventListener("webglcontextrestored", this.#refill); // after three's own, which makes its state new
  }

  #refill = (): void => {
    if (this.#renderer === null) return;
    for (const upload of this.#uploads.values()) this.#warmer.warm(upload, this.#mode, this.#renderer);
  };
}

function checkSize(packed: Packed, renderer: WebGLRenderer): void {
  if (packed.kind === "static") return;
  const { textureWidth, textureHeight, texels, colors } = packed;
  const most = renderer.capabilities.maxTextureSize;
  const splatRows = (packed.splats?.words.length ?? 0) / 4 / SPLATS_WIDTH;
  if (splatRows > most) throw new RangeError(`group of chunk ${packed.chunk}: ${packed.splats!.count} splats, ${splatRows} rows of a texture, the GPU's largest is ${most}; choose fewer layers`);
  const size = `a texture of ${textureWidth} x ${textureHeight}`;
  if (Math.max(textureWidth, textureHeight) > most) throw new RangeError(`group of chunk ${packed.chunk}: ${size}, the GPU's largest is ${most}; choose fewer layers`);
  if (texels.length !== 4 * textureWidth * textureHeight) throw new RangeError(`group of chunk ${packed.chunk}: ${texels.length / 4} texels for ${size}`);
  if (colors !== null && colors.length !== texels.length) throw new RangeError(`group of chunk ${packed.chunk}: ${colors.length / 4} colours for ${size}`);
}
