// The splats of a track: one triangle each, whose places the GPU works out from the group's vertices; only their order is uploaded.

import { DynamicDrawUsage, GLSL3, InstancedBufferAttribute, InstancedBufferGeometry, Matrix4, Mesh, RawShaderMaterial, Vector2, Vector3, Vector4 } from "three";
import type { Camera, DataTexture, IUniform, WebGLRenderer } from "three";
import type { PackedGroup, PackedSplats } from "@meshreel/player-core/types";
import type { Vector } from "./colors.ts";
import type { PartUniforms } from "./materials.ts";
import { localFrame } from "./ranges.ts";
import type { Sorter } from "./sorter.ts";
import { SPLAT_FRAGMENT, SPLAT_VERTEX } from "./splat_shaders.ts";
import type { Upload } from "./upload.ts";

const TURNED = 1e-3; // how far a unit vector goes until splats are ordered anew
const CORNERS = 3; // of what is drawn for a splat

interface SplatUniforms {
  readonly splats: IUniform<DataTexture | null>;
  readonly splatUnit: IUniform<number>;
  readonly viewport: IUniform<Vector2>;
}

type Shown = PackedGroup & { readonly splats: PackedSplats };

/** Shows the splats of one upload at a time. Those of the next are drawn in the last order until theirs has come: most often they are the same. */
export class SplatMesh extends Mesh<InstancedBufferGeometry, RawShaderMaterial> {
  readonly #own: SplatUniforms = { splats: { value: null }, splatUnit: { value: 0 }, viewport: { value: new Vector2() } };
  readonly #sorter: Sorter;
  readonly #key: number;
  #shown: Shown | null = null;
  #frame = 0; // of the group
  #asked: { readonly shown: Shown; readonly frame: number; readonly forward: Vector } | null = null;
  #order: InstancedBufferAttribute | null = null;
  readonly #view = new Matrix4();
  readonly #viewport = new Vector4();
  readonly #middle = new Vector3(); // of the box
  readonly #scratch = new Vector3();

  constructor(uniforms: PartUniforms, sorter: Sorter) {
    super(new InstancedBufferGeometry());
    this.material = new RawShaderMaterial({
      name: "meshreel splats", glslVersion: GLSL3, vertexShader: SPLAT_VERTEX, fragmentShader: SPLAT_FRAGMENT,
      transparent: true, premultipliedAlpha: true, depthWrite: false,
    });
    Object.assign(this.material.uniforms, uniforms, this.#own); // the part's own: changes of them take effect at once
    this.geometry.setDrawRange(0, CORNERS);
    this.#sorter = sorter;
    this.#key = sorter.join((order) => this.#take(order));
    this.frustumCulled = this.visible = false;
  }

  /** Splats that are drawn. */
  get splatCount(): number {
    return this.visible ? (this.#shown?.splats.count ?? 0) : 0;
  }

  /** Bytes of their order on the GPU. */
  get bytes(): number {
    return this.#order?.array.byteLength ?? 0;
  }

  /** Shows those of an upload that has some, in the frame of the recording that is nearest to what is shown. */
  show(upload: Upload, frame: number): void {
    const shown = upload.packed as Shown;
    this.#frame = localFrame(shown, frame);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const { count, unit } = shown.splats;
    if (this.#order?.count !== count) this.#renew(count);
    this.#own.splats.value = upload.splats;
    this.#own.splatUnit.value = unit;
    const { minimum, size } = shown.box;
    this.#middle.set(...size).multiplyScalar(0.5).add(this.#scratch.set(...minimum));
    this.visible = true;
  }

  /** Keeps no reference to what it showed, but for the order. */
  hide(): void {
    this.visible = false;
    this.#shown = this.#asked = this.#own.splats.value = null;
  }

  override dispose(): void {
    super.dispose();
    this.hide();
    this.#sorter.leave(this.#key);
    this.geometry.dispose();
    this.material.dispose();
  }

  override onBeforeRender = (renderer: WebGLRenderer, _: unknown, camera: Camera): void => {
    const { z, w } = renderer.getCurrentViewport(this.#viewport);
    this.#own.viewport.value.set(z, w);
    this.material.uniformsNeedUpdate = true;
    const { elements } = this.#view.multiplyMatrices(camera.matrixWorldInverse, this.matrixWorld);
    const length = Math.hypot(elements[2], elements[6], elements[10]);
    this.#sort([-elements[2] / length, -elements[6] / length, -elements[10] / length]);
    const depth = -this.#scratch.copy(this.#middle).applyMatrix4(this.#view).z; // tracks one behind the other, from the next picture on
    this.renderOrder = 1 / (1 + Math.max(0, depth));
  };

  #sort(forward: Vector): void {
    const [shown, frame, asked] = [this.#shown, this.#frame, this.#asked];
    if (shown === null) return;
    const isTurned = asked === null || Math.hypot(...forward.map((value, k) => value - asked.forward[k])) > TURNED;
    if (!isTurned && asked.shown === shown && asked.frame === frame) return;
    const { vertexCount, box, splats } = shown;
    const texels = shown.texels.subarray(4 * frame * vertexCount, 4 * (frame + 1) * vertexCount);
    if (this.#sorter.ask(this.#key, { splats, texels, box, forward })) this.#asked = { shown, frame, forward };
  }

  /** An order that came late, of other splats, is none. */
  #take(order: Uint32Array): void {
    if (order.length === 0) this.#asked = null;
    if (this.#order?.count !== order.length) return;
    this.#order.array.set(order);
    this.#order.needsUpdate = true;
  }

  /** As they come, until their order does. */
  #renew(count: number): void {
    this.geometry.dispose();
    this.#order = new InstancedBufferAttribute(Uint32Array.from({ length: count }, (_, k) => k), 1);
    this.#order.setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("order", this.#order);
    this.geometry.instanceCount = count;
  }
}
