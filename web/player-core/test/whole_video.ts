// A whole .reel file in memory, frame by frame, as tests look at it; the player decodes in workers instead.

import { FormatError } from "../src/errors.ts";
import { Form } from "../src/format/layout.gen.ts";
import { checkPayload } from "../src/format/payload.ts";
import { Head, describe } from "../src/format/reader.ts";
import type { Chunk } from "../src/format/reader.ts";
import type { CompanionKind } from "../src/types.ts";
import type { Core, Handle, ShownFrame } from "../src/wasm/core.ts";

/** A triangle mesh; legal without faces and without vertices (an empty frame). */
export interface Mesh {
  readonly vertices: Float64Array; // x, y, z of each
  readonly faces: Int32Array; // three vertices of each, counter-clockwise from outside
  readonly colors?: Uint8Array | undefined; // red, green and blue of each vertex, sRGB
}

const GREY = 128; // red, green and blue of vertices without colours beside some with colours

type Triple = readonly [number, number, number];

/** A Gaussian in space. */
export interface Bound {
  readonly means: Triple;
  readonly axes: readonly Triple[]; // along the longer scale, the shorter, and the normal
  readonly scales: Triple; // standard deviations along these
  readonly opacities: number; // 0 where the frame lacks the face, or that has no area
  readonly colors: Triple; // sRGB, 0 to 1
}

export class Video {
  readonly head: Head;
  private readonly chunks = new Map<number, Handle | FormatError>();

  constructor(
    private readonly core: Core,
    private readonly data: Uint8Array,
    private readonly layers: number | null = null,
  ) {
    this.head = Head.parse(data);
  }

  /** Frame `index` in metres: its background, then its tracks, as one mesh with its colours. FormatError where a chunk is damaged. */
  frame(index: number): Mesh {
    const state = this.head.staticOfFrame(index);
    const background = state === null ? [] : [this.core.show(this.opened(state), 0)];
    return concatenate([...background, ...this.tracks(index)]);
  }

  /** The splats of frame `index` in metres, of all tracks; null where none has some. FormatError where a chunk is damaged. */
  splats(index: number): Bound[] | null {
    const found = this.tracks(index).flatMap(({ splats: [means, axes, scales, opacities, colors] }) =>
      Array.from(opacities, (opacity, k): Bound => {
        const triple = (numbers: Float64Array, at: number): Triple => [numbers[3 * at], numbers[3 * at + 1], numbers[3 * at + 2]];
        return { means: triple(means, k), axes: [0, 1, 2].map((n) => triple(axes, 3 * k + n)), scales: triple(scales, k), opacities: opacity, colors: triple(colors, k) };
      }),
    );
    return found.length === 0 ? null : found;
  }

  private tracks(index: number): ShownFrame[] {
    return this.head.tracks.map((_, track) => {
      const chunk = this.head.chunkOfFrame(index, track);
      return this.core.show(this.opened(chunk), index - chunk.firstFrame);
    });
  }

  /** A chunk with its companions, decoded once; where it is damaged its error is kept, so that no frame more decodes it again. */
  private opened(chunk: Chunk): Handle {
    let made = this.chunks.get(chunk.number);
    if (made === undefined) {
      try {
        made = this.open(chunk);
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        made = error;
      }
      this.chunks.set(chunk.number, made);
    }
    if (made instanceof FormatError) throw made;
    return made;
  }

  private open(chunk: Chunk): Handle {
    const isGroup = chunk.kind === "group";
    const before = isGroup ? this.head.groupBefore(chunk) : this.head.changedFrom(chunk);
    const previous = before && this.opened(before);
    const { scale, origin } = this.head.header;
    const layers = isGroup ? this.layers : null;
    const made = this.core.open({ payload: this.payload(chunk, layers), frames: isGroup ? chunk.frameCount : null, layers, previous, isShown: true, scale, origin });
    for (const kind of ["colors", "splats"] as const) {
      const of = this.companionOf(chunk, kind);
      if (of) this.core.dress(made, kind, this.payload(of, kind === "colors" && chunk.form !== Form.LAYERS ? null : layers));
    }
    return made;
  }

  private companionOf(chunk: Chunk, wanted: CompanionKind): Chunk | null {
    return this.head.companionsOf(chunk).find(({ kind }) => kind === wanted) ?? null;
  }

  private payload(chunk: Chunk, most: number | null): Uint8Array {
    const layers = chunk.layers.slice(0, most === null ? chunk.layers.length : most + 1);
    const size = layers.reduce((sum, layer) => sum + layer.size, 0);
    const payload = this.data.subarray(chunk.offset, chunk.offset + size);
    checkPayload(describe(chunk), chunk.form, payload, layers);
    return payload;
  }
}

/** The vertices and faces of all meshes, one behind the other. Where some vertices have colours, those of the others are grey. */
function concatenate(meshes: readonly ShownFrame[]): Mesh {
  const [vertices, faces, colors] = [[] as number[], [] as number[], [] as number[]];
  for (const mesh of meshes) {
    const first = vertices.length / 3;
    for (const value of mesh.vertices) vertices.push(value);
    for (const value of mesh.faces) faces.push(value + first);
    for (let k = 0; k < mesh.vertices.length; k++) colors.push(mesh.colors.length > 0 ? mesh.colors[k] : GREY);
  }
  const isColored = meshes.some((mesh) => mesh.colors.length > 0);
  return { vertices: Float64Array.from(vertices), faces: Int32Array.from(faces), colors: isColored ? Uint8Array.from(colors) : undefined };
}
