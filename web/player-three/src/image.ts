// The texture of a part: one on the GPU, into which each picture is copied when it is shown.

import { ClampToEdgeWrapping, LinearFilter, LinearMipmapLinearFilter, VideoFrameTexture } from "three";
import type { Texture, WebGLRenderer } from "three";
import type { TextureImage } from "@meshreel/player-core/types";

const WITH_MIPMAPS = 4 / 3;
const SMALLER = 3; // levels that gutters keep charts apart in: on smaller ones they run into each other
const ANISOTROPY = 8; // at most, where the GPU has it: surfaces are mostly seen aslant (guess)
const TEXEL_BYTES = 4;

export class ImageTexture {
  #texture: VideoFrameTexture | null = null;
  #image: TextureImage | null = null;
  #size = [0, 0];
  #gl: WebGL2RenderingContext | null = null;

  /** The texture with a picture in it, which must stay open as long as it is shown; null for none. */
  show(image: TextureImage | null): Texture | null {
    if (image === null) {
      this.#image = null;
      return null;
    }
    if (image === this.#image) return this.#texture;
    const { displayWidth: width, displayHeight: height } = image;
    if (this.#texture === null || width !== this.#size[0] || height !== this.#size[1]) this.#renew();
    this.#size = [width, height];
    this.#image = image;
    this.#texture!.setFrame(image);
    return this.#texture;
  }

  /** To be called before the texture is drawn: who draws it makes it. */
  drawnBy(renderer: WebGLRenderer): void {
    this.#gl = renderer.getContext() as WebGL2RenderingContext;
  }

  get bytes(): number {
    return this.#texture === null ? 0 : Math.round(this.#size[0] * this.#size[1] * TEXEL_BYTES * WITH_MIPMAPS);
  }

  dispose(): void {
    this.#texture?.dispose();
    this.#texture = this.#image = null;
  }

  /** Bytes as they are: the screen's colours (sRGB), like all others here. A format that the GPU takes to linear would cost browsers a copy a picture. */
  #renew(): void {
    this.#texture?.dispose();
    const texture = new VideoFrameTexture();
    texture.wrapS = texture.wrapT = ClampToEdgeWrapping;
    texture.magFilter = LinearFilter;
    texture.minFilter = LinearMipmapLinearFilter;
    texture.generateMipmaps = true;
    texture.anisotropy = ANISOTROPY;
    texture.onUpdate = () => this.#gl?.texParameteri(this.#gl.TEXTURE_2D, this.#gl.TEXTURE_MAX_LEVEL, SMALLER); // it is bound then
    texture.flipY = false;
    this.#texture = texture;
  }
}
