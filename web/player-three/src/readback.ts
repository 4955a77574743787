// Positions read back from the GPU: the very buffers and textures that a picture is drawn from, through the same shader code.

import { Camera, GLSL3, NoBlending, Points, RawShaderMaterial, RGBAIntegerFormat, Scene, UnsignedIntType, Vector2, WebGLRenderTarget } from "three";
import type { BufferGeometry, WebGLRenderer } from "three";
import { makeUniforms } from "./materials.ts";
import type { PartUniforms } from "./materials.ts";
import { drawOffscreen } from "./offscreen.ts";
import { setFrame, setUpload } from "./part.ts";
import { vertexRoom } from "./ranges.ts";
import { DRAWN, READBACK_FRAGMENT, readbackVertex } from "./shaders.ts";
import type { Upload } from "./upload.ts";

const WIDTH = 2048;

/**
 * Positions of all vertices that the triangles of a frame use, in the order of their numbers, three float32 each; NaN for those
 * that none uses. It waits for the GPU: for tests and measurements, no part of the built player.
 */
export function readPositions(upload: Upload, renderer: WebGLRenderer, frame: number, blend: number): Float32Array {
  const count = vertexRoom(upload.packed);
  const height = Math.max(1, Math.ceil(count / WIDTH));
  const target = new WebGLRenderTarget(WIDTH, height, {
    format: RGBAIntegerFormat,
    type: UnsignedIntType,
    internalFormat: "RGBA32UI",
    depthBuffer: false,
  });
  const uniforms = makeUniforms();
  setUpload(uniforms, upload);
  const geometries = upload.indexed;
  const extra = geometries[1] ?? null;
  if (upload.packed.kind === "group") setFrame(uniforms, extra, upload.packed, frame, blend);
  const material = readbackMaterial(upload, uniforms, new Vector2(WIDTH, height));
  drawInto(target, geometries, material, renderer);
  const pixels = new Uint32Array(4 * WIDTH * height);
  renderer.readRenderTargetPixels(target, 0, 0, WIDTH, height, pixels);
  target.dispose();
  material.dispose();
  return positionsOf(pixels, count);
}

function readbackMaterial(upload: Upload, uniforms: PartUniforms, targetSize: Vector2): RawShaderMaterial {
  return new RawShaderMaterial({
    name: "meshreel readback",
    glslVersion: GLSL3,
    vertexShader: readbackVertex(upload.packed.kind === "group" ? "texture" : "attribute"),
    fragmentShader: READBACK_FRAGMENT,
    uniforms: { ...uniforms, targetSize: { value: targetSize } },
    depthTest: false,
    depthWrite: false,
    blending: NoBlending,
  });
}

function drawInto(target: WebGLRenderTarget, geometries: readonly BufferGeometry[], material: RawShaderMaterial, renderer: WebGLRenderer): void {
  const scene = new Scene();
  for (const geometry of geometries) {
    const points = new Points(geometry, material);
    points.frustumCulled = false;
    scene.add(points);
  }
  drawOffscreen(renderer, target, () => {
    renderer.clear();
    renderer.render(scene, new Camera());
  });
}

function positionsOf(pixels: Uint32Array, count: number): Float32Array {
  const floats = new Float32Array(pixels.buffer);
  const positions = new Float32Array(3 * count);
  for (let v = 0; v < count; v++) {
    const drawn = pixels[4 * v + 3] === DRAWN;
    for (let k = 0; k < 3; k++) positions[3 * v + k] = drawn ? floats[4 * v + k] : NaN;
  }
  return positions;
}
