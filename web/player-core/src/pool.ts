// Decoding workers.

import type { FromWorker, ToWorker } from "./protocol.ts";

/** What the pool needs of a Worker; one of Node's `worker_threads` needs a wrapper. */
export interface WorkerLike {
  postMessage(message: ToWorker, transfer: Transferable[]): void;
  terminate(): void;
  onmessage: ((event: { data: FromWorker }) => void) | null;
  onerror: ((event: { message?: string }) => void) | null;
  onmessageerror: ((event: unknown) => void) | null;
}

/** How workers are made: for example `create: () => new Worker(new URL("./worker.ts", import.meta.url), { type: "module" })`. */
export interface WorkerSetup {
  readonly create: () => WorkerLike;
  readonly core: ArrayBuffer | string; // wasm bytes, or their URL
  readonly draco: ArrayBuffer | string;
  readonly count?: number; // workers; cores - 1 if not given, from 1 to 4
}
