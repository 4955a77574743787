// The ground under a recording: hardly seen itself, it takes the shadow of what stands on it or hangs close above.

import { CircleGeometry, CustomBlending, GLSL3, Group, LinearMipmapLinearFilter, Mesh, OneFactor, OneMinusSrcAlphaFactor, OrthographicCamera, RawShaderMaterial, WebGLRenderTarget } from "three";
import type { WebGLRenderer } from "three";
import type { Box } from "@meshreel/player-core/types";
import { drawOffscreen } from "./offscreen.ts";
import type { ReelScene } from "./scene.ts";
import { GROUND_FRAGMENT, GROUND_VERTEX } from "./shaders.ts";

const SIDE = 256; // texels of the shadow
const ASIDE = 0.35; // of the recording's size: how far the shadow's picture reaches beyond it (guess)
const REACH = 0.5; // of the recording's height: what hangs higher casts none (guess)
const RIM = 2; // of the half side of the shadow's picture: where the ground has faded away (guess)
const GLOWS = { bright: 0.08, dark: 0.2 }; // of the ground on pages: on dark ones a shadow is seen only where that is brighter (guess)
const BELOW = 0.002; // of its height: so that soles hide it

/** To be put beside a recording, in the space in which that stands upright. */
export class Ground extends Group {
  readonly #target = new WebGLRenderTarget(SIDE, SIDE, { generateMipmaps: true, minFilter: LinearMipmapLinearFilter });
  readonly #eye = new OrthographicCamera(); // below the ground, looks up
  readonly #disc: Mesh<CircleGeometry, RawShaderMaterial>;

  constructor() {
    super();
    const material = new RawShaderMaterial({
      name: "meshreel ground",
      glslVersion: GLSL3,
      vertexShader: GROUND_VERTEX,
      fragmentShader: GROUND_FRAGMENT,
      uniforms: { shadow: { value: this.#target.texture }, rim: { value: RIM }, glow: { value: GLOWS.bright } },
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

  /** True on a dark background. */
  set isDark(isDark: boolean) {
    this.#disc.material.uniforms.glow!.value = isDark ? GLOWS.dark : GLOWS.bright;
  }

  /** Lies under a box. */
  lie({ minimum: [x, y, z], size: [width, height, depth] }: Box): void {
    const half = (0.5 + ASIDE) * Math.max(width, depth, REACH * height) || 1;
    this.position.set(x + width / 2, y - BELOW * height, z + depth / 2);
    this.#disc.scale.setScalar(half);
    Object.assign(this.#eye, { left: -half, right: half, bottom: -half, top: half, near: 0, far: REACH * (height || 1) });
    this.#eye.updateProjectionMatrix();
  }

  /** Takes the shadow of what a recording shows now. */
  shade(reel: ReelScene, renderer: WebGLRenderer): void {
    this.updateWorldMatrix(true, true);
    drawOffscreen(renderer, this.#target, () => {
      renderer.clear();
      reel.cast(() => renderer.render(reel, this.#eye));
    });
  }

  override dispose(): void {
    super.dispose();
    this.#target.dispose();
    this.#disc.geometry.dispose();
    this.#disc.material.dispose();
  }
}
