// The inside of a decoding worker: jobs in, packed groups out. Keeps what groups that follow are predicted from.

import { arraysOf } from "../bytes.ts";
import { FormatError } from "../errors.ts";
import { checkPayload } from "../format/payload.ts";
import { describe } from "../format/reader.ts";
import type { Damage, DecodeJob } from "../protocol.ts";
import type { Box, Packed, PackedVertices } from "../types.ts";
import type { Core, Handle, PackedArrays } from "../wasm/core.ts";

const MOST_STATES = 64; // of groups, of all tracks and files; the oldest goes first
const MOST_STATICS = 4;
const TEXTURE_WIDTH = 2048; // that every WebGL 2 has
const ORIGIN = [0, 0, 0]; // of what is packed: the header's, from which positions are counted

/** A job whose predecessor this worker has not, or no longer: the chain is to be sent again. */
export class MissingState extends Error {
  override name = "MissingState";
}

/** Opened chunks by file and number, up to a number of them. */
class Kept {
  private readonly chunks = new Map<string, Handle>();

  constructor(
    private readonly core: Core,
    private readonly most: number,
  ) {}

  get(file: number, chunk: number): Handle | undefined {
    return this.chunks.get(`${file}/${chunk}`);
  }

  set(file: number, chunk: number, value: Handle): void {
    const key = `${file}/${chunk}`;
    this.close(key); // so that it counts as the newest
    this.chunks.set(key, value);
    for (const oldest of this.chunks.keys()) {
      if (this.chunks.size <= this.most) break;
      this.close(oldest);
    }
  }

  forget(file: number): void {
    for (const key of [...this.chunks.keys()]) if (key.startsWith(`${file}/`)) this.close(key);
  }

  private close(key: string): void {
    const chunk = this.chunks.get(key);
    if (chunk !== undefined) this.core.close(chunk);
    this.chunks.delete(key);
  }
}

export class ChunkDecoder {
  private readonly groups: Kept;
  private readonly statics: Kept;

  constructor(private readonly core: Core) {
    [this.groups, this.statics] = [new Kept(core, MOST_STATES), new Kept(core, MOST_STATICS)];
  }

  /**
   * What the job's chunk is, in metres from the header's origin; null where only its state is wanted. A companion that cannot be decoded is
   * told to `damage`, and the chunk is decoded without it.
   */
  decode(job: DecodeJob, damage: (damage: Damage) => void): Packed | null {
    const start = performance.now();
    checkPayload(describe({ ...job, number: job.chunk }), job.form, job.payload, job.ranges);
    const isGroup = job.kind === "group";
    const kept = isGroup ? this.groups : this.statics;
    const { payload, layers, scale } = job;
    const frames = isGroup ? job.frameCount : null;
    const chunk = this.core.open({ payload, frames, layers, previous: previousOf(kept, job), isShown: !job.stateOnly, scale, origin: ORIGIN });
    let packed: Packed | null = null;
    try {
      this.dress(chunk, job, damage);
      if (!job.stateOnly) packed = packedOf(this.core.pack(chunk, job.textured), job, start);
      this.core.trim(chunk);
    } catch (error) {
      if (error instanceof FormatError) this.core.close(chunk);
      throw error;
    }
    kept.set(job.file, job.chunk, chunk);
    return packed;
  }

  /** Frees what is kept of a file. */
  forget(file: number): void {
    this.groups.forget(file);
    this.statics.forget(file);
  }

  /** Decodes the companions of a job's chunk. Throws what stops the core, damage or not. */
  private dress(chunk: Handle, job: DecodeJob, damage: (damage: Damage) => void): void {
    for (const { chunk: number, kind, form, payload, ranges } of job.companions) {
      if (kind === "pictures" || kind === "compatible") continue;
      try {
        checkPayload(describe({ ...job, number, kind }), form, payload, ranges);
        this.core.dress(chunk, kind, payload);
      } catch (error) {
        damage({ chunk: number, message: error instanceof Error ? error.message : String(error) });
        if (!(error instanceof FormatError)) throw error;
      }
    }
  }
}

function previousOf(kept: Kept, job: DecodeJob): Handle | null {
  if (job.previous === null) return null;
  const chunk = kept.get(job.file, job.previous);
  if (chunk === undefined) throw new MissingState(`chunk ${job.chunk} needs chunk ${job.previous}, which is not at hand`);
  return chunk;
}

function packedOf(arrays: PackedArrays, job: DecodeJob, start: number): Packed {
  const { vertexCount, faces, extra, extraStarts, splatCount, words, unit } = arrays;
  const bytes = job.companions.reduce((sum, other) => sum + other.payload.length, job.payload.length); // that it was decoded from
  const common = { chunk: job.chunk, ...verticesOf(arrays), vertexCount, faces, bytes, decodeMs: performance.now() - start };
  if (job.kind === "static") return { kind: "static", ...common };
  const { track, firstFrame, frameCount } = job;
  const splats = splatCount === 0 ? null : { count: splatCount, words, unit };
  const shape = { textureWidth: TEXTURE_WIDTH, textureHeight: arrays.rows, extra, extraStarts, splats, layers: Math.max(0, job.ranges.length - 1) };
  return { kind: "group", track, firstFrame, frameCount, ...shape, ...common };
}

function verticesOf({ bounds, texels, colors, width, height, places, extraPlaces }: PackedArrays): PackedVertices {
  const minimum = [...bounds.subarray(0, 3)] as unknown as Box["minimum"];
  const size = minimum.map((low, k) => bounds[3 + k] - low) as unknown as Box["size"];
  const placed = width === 0 ? null : { width, height, faces: places, extra: extraPlaces };
  return { texels, colors: colors.length === 0 ? null : colors, box: { minimum, size }, places: placed };
}

/** The buffers of a packed value, to be handed over with it. */
export function buffersOf(packed: Packed): ArrayBufferLike[] {
  return [...new Set(arraysOf(packed).map((array) => array.buffer))];
}
