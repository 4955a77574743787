// Stand-ins for decoding workers: they keep to the protocol, refuse what breaks its laws, and take the time they are told.

import { crc32 } from "../src/format/crc.ts";
import { Form } from "../src/format/layout.gen.ts";
import type { WorkerLike, WorkerSetup } from "../src/time/pool.ts";
import type { DecodeJob, FromWorker, ToWorker } from "../src/protocol.ts";
import type { Packed, PackedSplats } from "../src/types.ts";

export interface Done {
  readonly job: DecodeJob;
  readonly worker: number;
}

export class FakeWorkers {
  readonly workers: FakeWorker[] = [];
  /** Jobs in the order in which they started. */
  readonly begun: Done[] = [];
  /** What no worker may be asked to do, found out all the same. */
  readonly offences: string[] = [];
  /** How long a job takes, ms. */
  msOf: (job: DecodeJob) => number = () => 5;
  startMs = 1;
  /** Called when a job starts; may crash or trap its worker. */
  onJob: (worker: FakeWorker, job: DecodeJob) => "go on" | "say nothing" = () => "go on";
  mostStates = 64;
  /** Bytes of texels that a frame decodes to. */
  bytesPerFrame = 800;

  setup(count = 1, silenceMs?: number): WorkerSetup {
    const setup = { create: () => this.#create(), core: new ArrayBuffer(8), count };
    return silenceMs === undefined ? setup : { ...setup, silenceMs };
  }

  /** Chunks that jobs were begun for. */
  get chunks(): number[] {
    return this.begun.map(({ job }) => job.chunk);
  }

  #create(): FakeWorker {
    const worker = new FakeWorker(this, this.workers.length);
    this.workers.push(worker);
    return worker;
  }
}

export class FakeWorker implements WorkerLike {
  onmessage: ((event: { data: FromWorker }) => void) | null = null;
  onerror: ((event: { message?: string }) => void) | null = null;
  onmessageerror: ((event: unknown) => void) | null = null;
  isTerminated = false;
  readonly forgotten: number[] = [];
  readonly number: number;
  readonly #all: FakeWorkers;
  readonly #states = new Map<string, number>(); // layers beyond the first, by file and chunk
  #isStarted = false;
  #isBusy = false;

  constructor(all: FakeWorkers, number: number) {
    this.#all = all;
    this.number = number;
  }

  postMessage(sent: ToWorker, transfer: Transferable[]): void {
    const message = structuredClone(sent, { transfer });
    if (this.isTerminated) this.#all.offences.push(`worker ${this.number}: a message behind its end`);
    if (message.type === "start") setTimeout(() => this.#start(), this.#all.startMs);
    else if (message.type === "forget") {
      this.forgotten.push(message.file);
      this.#states.clear();
    } else this.#decode(message.id, message.job);
  }

  terminate(): void {
    this.isTerminated = true;
  }

  crash(message = "out of memory"): void {
    this.onerror?.({ message });
  }

  #start(): void {
    this.#isStarted = true;
    this.#answer({ type: "started" });
  }

  #answer(message: FromWorker): void {
    if (!this.isTerminated) this.onmessage?.({ data: message });
  }

  #decode(id: number, job: DecodeJob): void {
    this.#all.begun.push({ job, worker: this.number });
    if (!this.#isStarted) this.#all.offences.push(`chunk ${job.chunk}: sent before the worker has started`);
    if (this.#isBusy) this.#all.offences.push(`chunk ${job.chunk}: sent while another is being decoded`);
    this.#isBusy = true;
    if (this.#all.onJob(this, job) === "say nothing") return;
    const wrong = this.#wrongWith(job);
    const missing = job.previous !== null && !this.#states.has(`${job.file}/${job.previous}`);
    setTimeout(() => {
      this.#isBusy = false;
      if (wrong || missing) this.#answer({ type: "failed", id, message: wrong || "the state is not there", damage: [], missingState: !wrong });
      else this.#finish(id, job);
    }, this.#all.msOf(job));
  }

  #finish(id: number, job: DecodeJob): void {
    if (job.form === Form.LAYERS || job.kind === "static") {
      this.#states.delete(`${job.file}/${job.chunk}`);
      this.#states.set(`${job.file}/${job.chunk}`, job.layers ?? Infinity);
      for (const key of this.#states.keys()) if (this.#states.size > this.#all.mostStates) this.#states.delete(key);
    }
    const packed = job.stateOnly ? null : packedOf(job, this.#all.bytesPerFrame);
    const damage = job.companions.filter((companion) => isDamaged(companion)).map(({ chunk }) => ({ chunk, message: "a layer is damaged" }));
    this.#answer({ type: "decoded", id, packed, damage, ms: this.#all.msOf(job) });
  }

  /** Damage, which a real worker finds, too; and offences of the player, which it would not. */
  #wrongWith(job: DecodeJob): string {
    const { offences } = this.#all;
    const size = job.ranges.reduce((sum, layer) => sum + layer.size, 0);
    if (size !== job.payload.length) offences.push(`chunk ${job.chunk}: ${job.payload.length} bytes for layers of ${size}`);
    if (job.layers !== null && job.ranges.length !== job.layers + 1) offences.push(`chunk ${job.chunk}: ${job.ranges.length} ranges for ${job.layers} layers beyond the first`);
    if (job.previous !== null && job.kind === "group") {
      const state = this.#states.get(`${job.file}/${job.previous}`);
      if (state !== undefined && state < job.ranges.length - 1) offences.push(`chunk ${job.chunk}: finer than chunk ${job.previous} before it`);
    }
    return isDamaged(job) ? "a layer is damaged" : "";
  }
}

function isDamaged({ payload, ranges }: Pick<DecodeJob, "payload" | "ranges">): boolean {
  let at = 0;
  return ranges.some(({ size, crc }) => crc32(payload.subarray(at, (at += size))) !== crc);
}

function packedOf(job: DecodeJob, bytesPerFrame: number): Packed {
  const box = { minimum: [0, 0, 0], size: [1, 1, 1] } as const;
  const shared = { chunk: job.chunk, vertexCount: 1, faces: new Uint32Array(3), box, colors: colorsOf(job), places: placesOf(job), bytes: job.payload.length, decodeMs: 1 };
  if (job.kind === "static") return { kind: "static", texels: new Uint16Array(4), ...shared };
  const { track, firstFrame, frameCount } = job;
  const texels = new Uint16Array((frameCount * bytesPerFrame) / 2);
  const layers = job.ranges.length - 1;
  const extra = { extra: new Uint32Array(0), extraStarts: new Uint32Array(frameCount + 1), textureWidth: 1, textureHeight: 1 };
  return { kind: "group", track, firstFrame, frameCount, layers, texels, splats: splatsOf(job), ...extra, ...shared };
}

/** One texel, where the colours are sound. */
function colorsOf({ companions }: DecodeJob): Uint8Array | null {
  return companions.some((companion) => companion.kind === "colors" && !isDamaged(companion)) ? new Uint8Array(4) : null;
}

/** One splat, where they are sound. */
function splatsOf({ companions }: DecodeJob): PackedSplats | null {
  const isThere = companions.some((companion) => companion.kind === "splats" && !isDamaged(companion));
  return isThere ? { count: 1, words: new Uint32Array(8), unit: 1 } : null;
}

/** Of a texture of 64 x 32 texels, where pictures will be shown. */
function placesOf({ textured }: DecodeJob): Packed["places"] {
  return textured ? { width: 64, height: 32, faces: new Uint16Array(6), extra: new Uint16Array(0) } : null;
}
