// Uploads ahead of time. three uploads what it draws, so this draws nothing of everything, into a target of one pixel.

import { BufferGeometry, Camera, Mesh, Scene, WebGLRenderTarget } from "three";
import type { RawShaderMaterial, WebGLRenderer } from "three";
import { BACKGROUND_CLAY, BACKGROUND_COLOR } from "./colors.ts";
import { Materials, makeUniforms } from "./materials.ts";
import type { Look } from "./materials.ts";
import type { Mode } from "./modes.ts";
import { drawOffscreen } from "./offscreen.ts";
import { Sorter } from "./sorter.ts";
import { SplatMesh } from "./splats.ts";
import type { Upload } from "./upload.ts";

const PAINT = { clay: BACKGROUND_CLAY, color: BACKGROUND_COLOR };
const NOTHING = new BufferGeometry();

export class Warmer {
  readonly #uniforms = makeUniforms();
  readonly #materials: Readonly<Record<"group" | "static", Materials>>;
  readonly #mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #splats = new SplatMesh(this.#uniforms, new Sorter(null));
  readonly #scene = new Scene();
  readonly #camera = new Camera();
  readonly #target = new WebGLRenderTarget(1, 1, { depthBuffer: false });

  constructor(look: Look) {
    this.#materials = { group: new Materials("texture", look, this.#uniforms, PAINT), static: new Materials("attribute", look, this.#uniforms, PAINT) };
    this.#mesh = new Mesh(NOTHING, this.#materials.group.of({ edges: false, places: false, patches: false }));
    this.#mesh.frustumCulled = false;
    this.#scene.add(this.#mesh);
  }

  /** Puts textures and buffers of an upload on the GPU, and compiles what draws them. */
  warm(upload: Upload, mode: Mode, renderer: WebGLRenderer): void {
    const edges = mode === "wireframe";
    const patches = mode === "splats" && upload.splats !== null;
    this.#mesh.material = this.#materials[upload.packed.kind].of({ edges, places: upload.isTextured, patches });
    const geometries = [upload.faces(edges), upload.extra(edges)].filter((geometry) => geometry !== null);
    this.#uniforms.vertices.value = upload.texture; // the geometries may have made it, as the other one
    this.#uniforms.colors.value = upload.colors;
    if (patches) {
      renderer.initTexture(upload.splats!);
      renderer.compile(this.#splats, this.#camera);
    }
    drawOffscreen(renderer, this.#target, () => {
      for (const geometry of geometries) this.#draw(geometry, renderer);
    });
    this.#mesh.geometry = NOTHING;
    this.#uniforms.vertices.value = this.#uniforms.colors.value = null;
  }

  dispose(): void {
    for (const materials of Object.values(this.#materials)) materials.dispose();
    this.#target.dispose();
    this.#splats.dispose();
  }

  #draw(geometry: BufferGeometry, renderer: WebGLRenderer): void {
    const { start, count } = geometry.drawRange;
    geometry.setDrawRange(0, 0);
    this.#mesh.geometry = geometry;
    renderer.render(this.#scene, this.#camera);
    geometry.setDrawRange(start, count);
  }
}
