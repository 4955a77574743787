// Decoding workers, one for each spare core, with one job at a time.

import type { Damage, DecodeJob, FromWorker, ToWorker } from "../protocol.ts";
import type { Packed } from "../types.ts";

/** The part of a Worker that the pool needs; a worker of Node's `worker_threads` needs a wrapper. */
export interface WorkerLike {
  postMessage(message: ToWorker, transfer: Transferable[]): void;
  terminate(): void;
  onmessage: ((event: { data: FromWorker }) => void) | null;
  onerror: ((event: { message?: string }) => void) | null;
  onmessageerror: ((event: unknown) => void) | null;
}

/** Bytes, or their URL. */
type Wasm = ArrayBuffer | string;

/** Options of the workers, for example `create: () => new Worker(new URL("../decode/worker.ts", import.meta.url), { type: "module" })`. */
export interface WorkerSetup {
  readonly create: () => WorkerLike;
  readonly core: Wasm | Promise<Wasm>;
  readonly count?: number; // workers; cores - 1 if not given, from 1 to 4
  readonly silenceMs?: number; // without an answer before a worker counts as dead; 30 000 if not given
}

export type Outcome =
  | { readonly kind: "decoded"; readonly packed: Packed | null; readonly damage: readonly Damage[]; readonly ms: number; readonly worker: number }
  | { readonly kind: "failed"; readonly message: string; readonly damage: readonly Damage[]; readonly missingState: boolean };

/** A job that waits for its worker. */
export interface Task {
  readonly lane: number; // jobs of one lane are done in one worker, in their order, because states live there
  start(): Omit<DecodeJob, "file">; // the job; its payloads' buffers must be its own
  settle(outcome: Outcome): void;
}

/** One file's share of a pool. */
export class Share {
  readonly #pool: WorkerPool;
  readonly file: number;
  readonly queue: Task[] = [];
  /** Called once, where no worker can be started. */
  onfatal: ((error: Error) => void) | null = null;

  constructor(pool: WorkerPool, file: number) {
    this.#pool = pool;
    this.file = file;
  }

  get size(): number {
    return this.#pool.size;
  }

  submit(task: Task): void {
    this.queue.push(task);
    this.#pool.run();
  }

  /** Cancels all jobs that have not started. */
  clear(): void {
    this.queue.length = 0;
  }

  /** True if the worker that did a job is still the one that its lane uses. */
  isAt(lane: number, worker: number): boolean {
    return this.#pool.slotOf(this, lane)?.serial === worker;
  }

  /** Leaves the pool: jobs are cancelled, states are forgotten. */
  close(): void {
    this.#pool.leave(this);
  }
}

interface Slot {
  readonly serial: number;
  readonly worker: WorkerLike;
  readonly lanes: Set<string>;
  isStarted: boolean;
  running: { id: number; share: Share; task: Task } | null;
  timer: ReturnType<typeof setTimeout> | undefined;
}

const FAILED_STARTS = 3; // in a row, before the pool gives up

export class WorkerPool {
  readonly size: number;
  readonly #setup: WorkerSetup;
  readonly #slots: Slot[] = [];
  readonly #shares = new Set<Share>();
  readonly #lanes = new Map<string, Slot>();
  #serial = 0;
  #failedStarts = 0;
  #error: Error | null = null;

  constructor(setup: WorkerSetup) {
    const cores = globalThis.navigator?.hardwareConcurrency ?? 2;
    this.size = setup.count ?? Math.min(4, Math.max(1, cores - 1));
    this.#setup = setup;
    this.#start(); // the others when it has started: what it loads they then have from the browser's cache
  }

  /** A share for one file more. */
  open(): Share {
    const share = new Share(this, ++this.#serial);
    this.#shares.add(share);
    if (this.#error !== null) queueMicrotask(() => share.onfatal?.(this.#error!));
    return share;
  }

  dispose(): void {
    for (const slot of this.#slots.splice(0)) this.#end(slot);
    this.#shares.clear();
  }

  /** Gives idle workers their next jobs. */
  run(): void {
    for (const share of [...this.#shares]) {
      const taken = new Set<Task>();
      for (const task of share.queue) {
        const slot = this.slotOf(share, task.lane) ?? this.#idlest();
        if (slot === null || !slot.isStarted || slot.running !== null) continue; // so will be the next of its lane
        taken.add(task);
        this.#post(slot, share, task);
      }
      if (taken.size === 0) continue;
      share.queue.splice(0, share.queue.length, ...share.queue.filter((task) => !taken.has(task)));
      this.#shares.delete(share); // the others are next
      this.#shares.add(share);
    }
  }

  slotOf(share: Share, lane: number): Slot | undefined {
    return this.#lanes.get(`${share.file}:${lane}`);
  }

  leave(share: Share): void {
    share.clear();
    this.#shares.delete(share);
    for (const [name, slot] of this.#lanes) {
      if (!name.startsWith(`${share.file}:`)) continue;
      this.#lanes.delete(name);
      slot.lanes.delete(name);
    }
    for (const slot of this.#slots) slot.worker.postMessage({ type: "forget", file: share.file }, []);
  }

  /** The idle worker with the fewest lanes. */
  #idlest(): Slot | null {
    const idle = this.#slots.filter((slot) => slot.isStarted && slot.running === null);
    return idle.reduce<Slot | null>((best, slot) => (best === null || slot.lanes.size < best.lanes.size ? slot : best), null);
  }

  #post(slot: Slot, share: Share, task: Task): void {
    const id = ++this.#serial;
    const lane = `${share.file}:${task.lane}`;
    this.#lanes.set(lane, slot);
    slot.lanes.add(lane);
    slot.running = { id, share, task };
    this.#watch(slot);
    const job: DecodeJob = { ...task.start(), file: share.file };
    const buffers = [job, ...job.companions].map(({ payload }) => payload.buffer as ArrayBuffer);
    slot.worker.postMessage({ type: "decode", id, job }, buffers);
  }

  #start(): void {
    let worker: WorkerLike;
    try {
      worker = this.#setup.create();
    } catch (error) {
      return this.#giveUp(error instanceof Error ? error.message : String(error));
    }
    const slot: Slot = { serial: ++this.#serial, worker, lanes: new Set(), isStarted: false, running: null, timer: undefined };
    this.#slots.push(slot);
    worker.onmessage = ({ data }) => this.#hear(slot, data);
    worker.onerror = (event) => this.#replace(slot, event.message || "it ended");
    worker.onmessageerror = () => this.#replace(slot, "its answer cannot be read");
    void Promise.resolve(this.#setup.core).then((core) => {
      if (!this.#slots.includes(slot)) return;
      this.#watch(slot); // from now on: bytes may take long to come
      worker.postMessage({ type: "start", core }, []);
    });
  }

  #hear(slot: Slot, message: FromWorker): void {
    clearTimeout(slot.timer);
    if (message.type === "started") {
      slot.isStarted = true;
      this.#failedStarts = 0;
      while (this.#slots.length < this.size) this.#start();
    } else if (!slot.isStarted) {
      return this.#replace(slot, message.type === "failed" ? message.message : "it answers before it has started");
    } else if (slot.running?.id === message.id) {
      this.#settle(slot, message.type === "decoded" ? { ...message, kind: "decoded", worker: slot.serial } : { ...message, kind: "failed" });
    }
    this.run();
  }

  /** No answer for long is as good as none: a browser that is out of memory may end a worker without a word. */
  #watch(slot: Slot): void {
    clearTimeout(slot.timer);
    const silence = this.#setup.silenceMs ?? 30_000;
    slot.timer = setTimeout(() => this.#replace(slot, `no answer for ${silence / 1000} s`), silence);
  }

  #replace(slot: Slot, message: string): void {
    const place = this.#slots.indexOf(slot);
    if (place < 0) return;
    this.#slots.splice(place, 1);
    this.#end(slot);
    if (!slot.isStarted && ++this.#failedStarts >= FAILED_STARTS) this.#giveUp(message);
    else this.#start();
    this.#settle(slot, { kind: "failed", message: `its decoder crashed (${message})`, damage: [], missingState: false });
  }

  #settle(slot: Slot, outcome: Outcome): void {
    const { running } = slot;
    slot.running = null;
    if (running !== null && this.#shares.has(running.share)) running.task.settle(outcome);
  }

  #end(slot: Slot): void {
    clearTimeout(slot.timer);
    slot.worker.onmessage = slot.worker.onerror = slot.worker.onmessageerror = null;
    slot.worker.terminate();
    for (const lane of slot.lanes) this.#lanes.delete(lane);
  }

  #giveUp(message: string): void {
    if (this.#error !== null || this.#slots.some((slot) => slot.isStarted)) return;
    this.#error = new Error(`the decoder cannot be started: ${message}; load the page again`);
    for (const share of this.#shares) share.onfatal?.(this.#error);
  }
}
