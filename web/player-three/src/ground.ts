// The ground under a recording: hardly seen itself, it takes the shadow of what stands on it or hangs close above.

import { CircleGeometry, CustomBlending, GLSL3, Group, LinearMipmapLinearFilter, Matrix4, Mesh, OneFactor, OneMinusSrcAlphaFactor, OrthographicCamera, RawShaderMaterial, WebGLRenderTarget } from "three";
import type { WebGLRenderer } from "three";
import type { Box } from "@meshreel/player-core/types";
import { ASIDE, BELOW, GLOW, REACH, RIM, TEXELS } from "./ground.gen.ts";
import { drawOffscreen } from "./offscreen.ts";
import type { ReelScene } from "./scene.ts";
import { GROUND_FRAGMENT, GROUND_VERTEX } from "./shaders.ts";

const THICK = 0.2; // of the shadow's reach: how far above and below the feet a room's floor takes it (guess)

/** To be put beside a recording, in the space in which that stands upright. */
export class Ground extends Group {
  readonly #target = new WebGLRenderTarget(TEXELS, TEXELS, { generateMipmaps: true, minFilter: LinearMipmapLinearFilter });
  readonly #eye = new OrthographicCamera(); // below the ground, looks up
  readonly #disc: Mesh<CircleGeometry, RawShaderMaterial>;

  constructor() {
    super();
    const material = new RawShaderMaterial({
      name: "meshreel ground",
      glslVersion: GLSL3,
      vertexShader: GROUND_VERTEX,
      fragmentShader: GROUND_FRAGMENT,
      uniforms: { shadow: { value: this.#target.texture }, rim: { value: RIM }, glow: { value: GLOW } },
      blending: CustomBlending, // of colours that have their alpha in them
      blendSrc: OneFactor,
      blendDst: OneMinusSrcAlphaFactor,
      transparent: true,
      depthWrite: false,
    });
    this.#disc = new Mesh(new CircleGeometry(RIM, 64).rotateX(-Math.PI / 2), material);
    this.#disc.renderOrder = -1; // of all that is transparent, first
    this.#eye.rotation.x = Math.PI / 2;
    this.add(this.#disc, this.#eye);
  }

  /** Lies under a box. */
  lie({ minimum: [x, y, z], size: [width, height, depth] }: Box): void {
    const half = (0.5 + ASIDE) * Math.max(width, depth, REACH * height) || 1;
    this.position.set(x + width / 2, y - BELOW * height, z + depth / 2);
    this.#disc.scale.setScalar(half);
    Object.assign(this.#eye, { left: -half, right: half, bottom: -half, top: half, near: 0, far: REACH * (height || 1) });
    this.#eye.updateProjectionMatrix();
  }

  /** Takes the shadow of what a recording shows now; `inRoom`, the room's floor does. */
  shade(reel: ReelScene, renderer: WebGLRenderer, inRoom: boolean): void {
    this.updateWorldMatrix(true, true);
    drawOffscreen(renderer, this.#target, () => {
      renderer.clear();
      reel.cast(() => renderer.render(reel, this.#eye));
    });
    if (!inRoom) return reel.darken(null);
    const [{ x: half }, high, { x, y, z }] = [this.#disc.scale, THICK * this.#eye.far, this.position];
    reel.darken(this.#target.texture, new Matrix4().makeScale(1 / half, 1 / high, 1 / half).multiply(new Matrix4().makeTranslation(-x, -y, -z)).multiply(reel.matrix));
  }

  override dispose(): void {
    super.dispose();
    this.#target.dispose();
    this.#disc.geometry.dispose();
    this.#disc.material.dispose();
  }
}
