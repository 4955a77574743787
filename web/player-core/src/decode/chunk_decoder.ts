// The inside of a decoding worker: jobs in, packed groups out. Keeps what groups that follow are predicted from.

import { decodeAtlas, finerPlaces } from "./atlas.ts";
import { arraysOf } from "../bytes.ts";
import type { Layout } from "./atlas.ts";
import { paintStatic } from "./colors.ts";
import type { Tools } from "./group.ts";
import { colorGroup, continueGroup, decodeStatic } from "./group.ts";
import type { LayersState } from "./layers.ts";
import { faceCount } from "../mesh.ts";
import type { Placement } from "../mesh.ts";
import { FormatError } from "../errors.ts";
import { led } from "../format/budget.ts";
import type { Led } from "../format/budget.ts";
import { checkPayload } from "../format/payload.ts";
import { packGroup, packStatic } from "./pack.ts";
import { checkShowable, packSplats } from "./pack_splats.ts";
import type { FineAtlas } from "./pack.ts";
import type { Damage, DecodeJob } from "../protocol.ts";
import { describe } from "../format/reader.ts";
import { decodeSplats, inherited } from "./splats.ts";
import type { ColoredMesh } from "../wasm/colors.ts";
import type { CompanionKind, Packed } from "../types.ts";

const MOST_STATES = 64; // of groups, of all tracks and files; the oldest goes first
const MOST_STATICS = 4;

/** A job whose predecessor this worker has not, or no longer: the chain is to be sent again. */
export class MissingState extends Error {
  override name = "MissingState";
}

/** Values by file and chunk, up to a number of them. */
class Kept<T> {
  private readonly values = new Map<string, T>();

  constructor(private readonly most: number) {}

  get(file: number, chunk: number): T | undefined {
    return this.values.get(`${file}/${chunk}`);
  }

  set(file: number, chunk: number, value: T): void {
    const key = `${file}/${chunk}`;
    this.values.delete(key); // so that it counts as the newest
    this.values.set(key, value);
    for (const oldest of this.values.keys()) {
      if (this.values.size <= this.most) break;
      this.values.delete(oldest);
    }
  }

  forget(file: number): void {
    for (const key of [...this.values.keys()]) if (key.startsWith(`${file}/`)) this.values.delete(key);
  }
}

export class ChunkDecoder {
  private readonly states = new Kept<LayersState>(MOST_STATES);
  private readonly statics = new Kept<Led>(MOST_STATICS);

  constructor(private readonly tools: Tools) {}

  /**
   * What the job's chunk is, in metres from the header's origin; null where only its state is wanted. A companion that cannot be decoded is
   * told to `damage`, and the chunk is decoded without it.
   */
  decode(job: DecodeJob, damage: (damage: Damage) => void): Packed | null {
    const start = performance.now();
    checkPayload(describe({ ...job, number: job.chunk }), job.form, job.payload, job.ranges);
    const place = { scale: job.scale, origin: [0, 0, 0] };
    const made = job.kind === "static" ? this.background(job, place, damage) : this.group(job, place, damage);
    return made && { ...made, decodeMs: performance.now() - start };
  }

  /** Frees what is kept of a file. */
  forget(file: number): void {
    this.states.forget(file);
    this.statics.forget(file);
  }

  private group(job: DecodeJob, place: Placement, damage: (damage: Damage) => void): Packed | null {
    const { file, chunk, track, firstFrame, layers, payload } = job;
    const { core } = this.tools;
    const previous = this.needed(this.states, job);
    const made = continueGroup(this.tools, payload, { frameCount: job.frameCount, layers, previous, place });
    const colored = companion(job, "colors", damage, (data) => colorGroup(core, made, data, { layers, previous }));
    const [colors, state] = colored ?? [null, made.state];
    const template = made.canvas[0];
    const layout = companion(job, "atlas", damage, (data) => decodeAtlas(core, data, template.base)) ?? previous?.layout ?? null;
    const own = companion(job, "splats", damage, (data) => checkShowable(decodeSplats(core, data, faceCount(template.base))));
    const carried = own ?? inherited(previous, template);
    if (state !== null) this.states.set(file, chunk, { ...state, layout, splats: carried });
    if (job.stateOnly) return null;
    const shape = packGroup(core, made.group, colors, job.textured ? fineAtlas(layout, template) : null);
    const splats = carried && packSplats(carried, made.group, template.levels, job.scale);
    return { kind: "group", chunk, track, firstFrame, ...shape, splats, layers: Math.max(0, job.ranges.length - 1), bytes: bytesOf(job), decodeMs: 0 };
  }

  private background(job: DecodeJob, place: Placement, damage: (damage: Damage) => void): Packed | null {
    const { core } = this.tools;
    const before = this.needed(this.statics, job);
    const made = decodeStatic(this.tools, job.payload, before && before.mesh, place);
    const mesh = companion(job, "colors", damage, (data) => paintStatic(core, made, data)) ?? made.mesh;
    this.statics.set(job.file, job.chunk, led(before, mesh, job.payload.length));
    if (job.stateOnly) return null;
    const layout = companion(job, "atlas", damage, (data) => decodeAtlas(core, data, made.added.base));
    const atlas = job.textured ? fineAtlas(layout, made.added, mesh) : null;
    return { kind: "static", chunk: job.chunk, ...packStatic(core, mesh, atlas), bytes: bytesOf(job), decodeMs: 0 };
  }

  private needed<T>(kept: Kept<T>, job: DecodeJob): T | null {
    if (job.previous === null) return null;
    const value = kept.get(job.file, job.previous);
    if (value === undefined) throw new MissingState(`chunk ${job.chunk} needs chunk ${job.previous}, which is not at hand`);
    return value;
  }
}

/** What a companion of a job's chunk decodes to; null where it has none, or a damaged one. Throws what stops the core, damage or not. */
function companion<T>(job: DecodeJob, kind: CompanionKind, damage: (damage: Damage) => void, decode: (payload: Uint8Array) => T): T | null {
  const found = job.companions.find((other) => other.kind === kind);
  if (found === undefined) return null;
  const { chunk, form, payload, ranges } = found;
  try {
    checkPayload(describe({ ...job, number: chunk, kind }), form, payload, ranges);
    return decode(payload);
  } catch (error) {
    damage({ chunk, message: error instanceof Error ? error.message : String(error) });
    if (error instanceof FormatError) return null;
    throw error;
  }
}

/** The places of the finest faces of a mesh; null where it has no textures, or where they are those of another mesh. */
function fineAtlas(layout: Layout | null, { base, levels }: ColoredMesh, shown = base): FineAtlas | null {
  if (layout === null || layout.places.length !== 2 * base.faces.length || shown.faces.length !== base.faces.length) return null;
  return { ...layout, places: finerPlaces(layout, levels) };
}

/** Bytes that a job's chunk is decoded from. */
function bytesOf({ payload, companions }: DecodeJob): number {
  return companions.reduce((sum, other) => sum + other.payload.length, payload.length);
}

/** The buffers of a packed value, to be handed over with it. */
export function buffersOf(packed: Packed): ArrayBufferLike[] {
  return [...new Set(arraysOf(packed).map((array) => array.buffer))];
}
