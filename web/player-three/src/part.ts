// A part of the scene: a track, or the background. Its meshes stay; what they show is swapped.

import { BufferGeometry, Group, Mesh } from "three";
import type { RawShaderMaterial } from "three";
import type { PackedGroup, TextureImage } from "@meshreel/player-core/types";
import { ImageTexture } from "./image.ts";
import { Materials, makeUniforms } from "./materials.ts";
import type { Look, Paint, PartUniforms } from "./materials.ts";
import { localFrame } from "./ranges.ts";
import type { Sorter } from "./sorter.ts";
import { SplatMesh } from "./splats.ts";
import type { Feed } from "./shaders.ts";
import type { Upload } from "./upload.ts";

const NOTHING = new BufferGeometry();

/** Shows one upload at a time. After the first picture of an upload nothing is allocated. */
export class Part extends Group {
  readonly #uniforms: PartUniforms = makeUniforms();
  readonly #materials: Materials;
  readonly #image = new ImageTexture();
  readonly #faces: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #extra: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #splats: SplatMesh | null;
  #edges = false;
  #withSplats = false;
  #upload: Upload | null = null;

  /** `sorter`: of what may have splats. */
  constructor(feed: Feed, look: Look, paint: Paint, sorter: Sorter | null = null) {
    super();
    this.#materials = new Materials(feed, look, this.#uniforms, paint);
    const plain = this.#materials.of({ edges: false, places: false, patches: false });
    this.#faces = new Mesh<BufferGeometry, RawShaderMaterial>(NOTHING, plain);
    this.#extra = new Mesh<BufferGeometry, RawShaderMaterial>(NOTHING, plain);
    this.#faces.onBeforeRender = this.#extra.onBeforeRender = (renderer) => this.#image.drawnBy(renderer);
    this.add(this.#faces, this.#extra);
    this.#splats = sorter && new SplatMesh(this.#uniforms, sorter);
    if (this.#splats !== null) this.add(this.#splats);
    this.visible = false;
  }

  get upload(): Upload | null {
    return this.#upload;
  }

  /** True if the edges of triangles are drawn, from the next `show` on. */
  set edges(edges: boolean) {
    if (edges === this.#edges) return;
    this.hide();
    this.#edges = edges;
  }

  /** True if splats are drawn, should there be some, from the next `show` on. */
  set withSplats(withSplats: boolean) {
    if (withSplats === this.#withSplats) return;
    this.hide();
    this.#withSplats = withSplats;
  }

  /** Splats that are drawn. */
  get splatCount(): number {
    return this.visible ? (this.#splats?.splatCount ?? 0) : 0;
  }

  /** Shows nothing, and keeps no reference to what it showed. */
  hide(): void {
    if (this.#upload === null) return;
    this.visible = false;
    this.#upload = null;
    this.#faces.geometry = this.#extra.geometry = NOTHING;
    this.#uniforms.vertices.value = this.#uniforms.colors.value = this.#uniforms.image.value = null;
    this.#image.show(null);
    this.#splats?.hide();
  }

  /** Bytes of its texture on the GPU, and of the order of its splats. */
  get ownBytes(): number {
    return this.#image.bytes + (this.#splats?.bytes ?? 0);
  }

  /** Shows a frame of the recording and what is `blend` of the way to the next one, with the frame's texture where it has one. */
  show(upload: Upload, frame: number, blend: number, image: TextureImage | null): void {
    if (upload !== this.#upload) this.#take(upload);
    this.#uniforms.image.value = this.#image.show(upload.isTextured ? image : null);
    this.#uniforms.hasImage.value = this.#uniforms.image.value !== null;
    if (upload.packed.kind === "static") return;
    const extra = this.#extra.geometry === NOTHING ? null : this.#extra.geometry;
    this.#extra.visible = setFrame(this.#uniforms, extra, upload.packed, frame, blend);
    if (this.#isSplatted(upload)) this.#splats?.show(upload, Math.round(frame + blend));
  }

  override dispose(): void {
    super.dispose();
    this.hide();
    this.#materials.dispose();
    this.#image.dispose();
    this.#splats?.dispose();
  }

  #take(upload: Upload): void {
    this.#upload = upload;
    this.visible = true;
    const patches = this.#isSplatted(upload);
    this.#faces.material = this.#extra.material = this.#materials.of({ edges: this.#edges, places: upload.isTextured, patches });
    this.#faces.visible = !patches;
    if (!patches) this.#splats?.hide();
    this.#faces.geometry = upload.faces(this.#edges);
    this.#extra.geometry = upload.extra(this.#edges) ?? NOTHING;
    this.#extra.visible = false;
    setUpload(this.#uniforms, upload);
  }

  #isSplatted({ splats }: Upload): boolean {
    return this.#withSplats && this.#splats !== null && splats !== null;
  }
}

/** Set what is equal in all frames. Call it after access to the upload's geometry, which may make the textures. */
export function setUpload(uniforms: PartUniforms, upload: Upload): void {
  uniforms.boxMinimum.value = upload.packed.box.minimum;
  uniforms.boxSize.value = upload.packed.box.size;
  uniforms.vertices.value = upload.texture;
  uniforms.colors.value = upload.colors;
  uniforms.hasColors.value = upload.packed.colors !== null;
  uniforms.movingCount.value = upload.packed.vertexCount;
}

/** Sets the frame, and the range of the extra faces of single frames; returns true where this frame has any. */
export function setFrame(uniforms: PartUniforms, extra: BufferGeometry | null, group: PackedGroup, frame: number, blend: number): boolean {
  const { frameCount, vertexCount, extraStarts } = group;
  const t = localFrame(group, frame);
  uniforms.here.value = t * vertexCount;
  uniforms.next.value = Math.min(t + 1, frameCount - 1) * vertexCount;
  uniforms.behind.value = (frameCount - 1) * vertexCount;
  uniforms.blend.value = blend;
  const count = extraStarts[t + 1] - extraStarts[t];
  extra?.setDrawRange(extraStarts[t], count);
  return count > 0;
}
