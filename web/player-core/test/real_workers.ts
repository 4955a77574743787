// The real inside of a worker, in this thread, behind the messages that a worker gets and gives.

import type { WorkerLike, WorkerSetup } from "../src/time/pool.ts";
import type { FromWorker, ToWorker } from "../src/protocol.ts";
import { serve } from "../src/decode/worker.ts";
import type { Scope } from "../src/decode/worker.ts";
import { coreWasm } from "./tools.ts";

export function realWorkers(count: number): WorkerSetup {
  return { create: () => new RealWorker(), core: coreWasm(), count };
}

class RealWorker implements WorkerLike {
  onmessage: ((event: { data: FromWorker }) => void) | null = null;
  onerror: ((event: { message?: string }) => void) | null = null;
  onmessageerror: ((event: unknown) => void) | null = null;
  readonly #scope: Scope = {
    onmessage: null,
    postMessage: (message, transfer) => {
      const data = structuredClone(message, { transfer });
      setTimeout(() => this.onmessage?.({ data }), 0);
    },
  };

  constructor() {
    serve(this.#scope);
  }

  postMessage(message: ToWorker, transfer: Transferable[]): void {
    const data = structuredClone(message, { transfer });
    setTimeout(() => this.#scope.onmessage?.({ data } as MessageEvent<ToWorker>), 0);
  }

  terminate(): void {
    this.#scope.onmessage = null;
  }
}
