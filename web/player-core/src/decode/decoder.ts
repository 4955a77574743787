// A whole .reel file in memory, frame by frame. Beside decoder.py; the player decodes in workers instead.

import { paintStatic } from "./colors.ts";
import { colorGroup, continueGroup, decodeStatic } from "./group.ts";
import type { Continued, Tools } from "./group.ts";
import { colorsOf, frameOf } from "./decoded.ts";
import type { GroupColors } from "./decoded.ts";
import { led } from "../format/budget.ts";
import type { Led } from "../format/budget.ts";
import { FormatError } from "../errors.ts";
import { EMPTY, concatenate, faceCount } from "../mesh.ts";
import type { Mesh, Placement } from "../mesh.ts";
import type { CompanionKind } from "../types.ts";
import { Form } from "../format/layout.gen.ts";
import { checkPayload } from "../format/payload.ts";
import { Head, describe } from "../format/reader.ts";
import type { Chunk } from "../format/reader.ts";
import { bind, decodeSplats, inherited } from "./splats.ts";
import type { Bound, Splats } from "./splats.ts";

/** A group with its colours and the splats of its chain, where it has some. */
interface Dressed extends Continued {
  readonly colors: GroupColors | null;
  readonly splats: Splats | null;
}

export class Video {
  readonly head: Head;
  private readonly place: Placement;
  private readonly groups = new Map<number, Dressed | FormatError>();
  private readonly states = new Map<number, Led | FormatError>();

  constructor(
    private readonly tools: Tools,
    private readonly data: Uint8Array,
    private readonly layers: number | null = null,
  ) {
    this.head = Head.parse(data);
    this.place = { scale: this.head.header.scale, origin: this.head.header.origin };
  }

  /** Frame `index` in metres: its background, then its tracks, as one mesh with its colours. FormatError where a chunk is damaged. */
  frame(index: number): Mesh {
    const state = this.head.staticOfFrame(index);
    const moving = this.head.tracks.map((_, track) => {
      const chunk = this.head.chunkOfFrame(index, track);
      const { group, colors } = this.decoded(chunk);
      const mesh = frameOf(group, index - chunk.firstFrame);
      return colors === null ? mesh : { ...mesh, colors: colorsOf(group, colors, index - chunk.firstFrame) };
    });
    return concatenate([state === null ? EMPTY : this.state(state).mesh, ...moving]);
  }

  /** The splats of frame `index` in metres, of all tracks; null where none has some. FormatError where a chunk is damaged. */
  splats(index: number): Bound[] | null {
    const tracks = this.head.tracks.map((_, track) => {
      const chunk = this.head.chunkOfFrame(index, track);
      const { group, splats, canvas } = this.decoded(chunk);
      if (splats === null || canvas.length === 0) return null;
      const { frameCount, vertexCount, positions, faces, dropped } = group;
      const part = <T extends Float64Array | Uint8Array>(all: T): T => {
        const size = all.length / frameCount;
        return all.subarray((index - chunk.firstFrame) * size, (index - chunk.firstFrame + 1) * size) as T;
      };
      const vertices = part(positions.subarray(0, 3 * frameCount * vertexCount));
      const carrier = { vertices, faces, levels: canvas[0].levels, dropped: dropped && part(dropped), unit: this.place.scale };
      return Array.from(splats.faces, (_, k) => bind(splats, k, carrier));
    });
    return tracks.every((track) => track === null) ? null : tracks.flatMap((track) => track ?? []);
  }

  private decoded(chunk: Chunk): Dressed {
    return once(this.groups, chunk, () => {
      const before = this.head.groupBefore(chunk);
      const known = before && this.decoded(before);
      const previous = known && known.state;
      const count = this.layers === null ? chunk.layers.length : this.layers + 1;
      const { layers, place } = this;
      const made = continueGroup(this.tools, this.payload(chunk, count), { frameCount: chunk.frameCount, layers, previous, place });
      const splats = this.splatsOf(chunk, made) ?? inherited(known && known.state && { faces: known.state.faces, splats: known.splats }, made.canvas[0]);
      const of = this.companionOf(chunk, "colors");
      if (of === null) return { ...made, colors: null, splats };
      const data = this.payload(of, chunk.form === Form.LAYERS && layers !== null ? layers + 1 : of.layers.length);
      const [colors, state] = colorGroup(this.tools.core, made, data, { layers, previous });
      return { ...made, state, colors, splats };
    });
  }

  private state(chunk: Chunk): Led {
    return once(this.states, chunk, () => {
      const changed = this.head.changedFrom(chunk);
      const before = changed && this.state(changed);
      const payload = this.payload(chunk, chunk.layers.length);
      const made = decodeStatic(this.tools, payload, before && before.mesh, this.place);
      const of = this.companionOf(chunk, "colors");
      const mesh = of === null ? made.mesh : paintStatic(this.tools.core, made, this.payload(of, of.layers.length));
      return led(before, mesh, payload.length);
    });
  }

  private companionOf(chunk: Chunk, wanted: CompanionKind): Chunk | null {
    return this.head.companionsOf(chunk).find(({ kind }) => kind === wanted) ?? null;
  }

  private splatsOf(chunk: Chunk, { canvas }: Continued): Splats | null {
    const of = this.companionOf(chunk, "splats");
    if (of === null) return null;
    return decodeSplats(this.tools.core, this.payload(of, this.layers === null ? of.layers.length : this.layers + 1), faceCount(canvas[0].base));
  }

  private payload(chunk: Chunk, count: number): Uint8Array {
    const layers = chunk.layers.slice(0, Math.max(count, 1));
    const size = layers.reduce((sum, layer) => sum + layer.size, 0);
    const payload = this.data.subarray(chunk.offset, chunk.offset + size);
    checkPayload(describe(chunk), chunk.form, payload, layers);
    return payload;
  }
}

/** What a chunk decodes to, made once; where it is damaged its error is kept, so that no frame more decodes it again. */
function once<T extends object>(known: Map<number, T | FormatError>, chunk: Chunk, make: () => T): T {
  let made = known.get(chunk.number);
  if (made === undefined) {
    try {
      made = make();
    } catch (error) {
      if (!(error instanceof FormatError)) throw error;
      made = error;
    }
    known.set(chunk.number, made);
  }
  if (made instanceof FormatError) throw made;
  return made;
}
