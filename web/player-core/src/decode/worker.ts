// The decoding worker: speaks protocol.ts. An error of one job is reported and the next one is decoded; a core that has stopped is started
// again.

import { ChunkDecoder, MissingState, buffersOf } from "./chunk_decoder.ts";
import type { Damage, DecodeJob, FromWorker, ToWorker } from "../protocol.ts";
import { Core, CoreStopped } from "../wasm/core.ts";

/** What a worker's global scope is here, and what a test's stand-in has. */
export interface Scope {
  postMessage(message: FromWorker, transfer: Transferable[]): void;
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
}

/** Installs the message handler of a scope. Messages are handled in order; a start that fails is reported as the failure of job -1. */
export function serve(scope: Scope): void {
  const worker = new Served(scope);
  let last: Promise<void> = Promise.resolve();
  scope.onmessage = (event) => {
    last = last.then(() => worker.answer(event.data)).catch((error: unknown) => {
      scope.postMessage({ type: "failed", id: -1, message: error instanceof Error ? error.message : String(error), damage: [], missingState: false }, []);
    });
  };
}

class Served {
  private decoder: ChunkDecoder | null = null;
  private core: WebAssembly.Module | null = null;

  constructor(private readonly scope: Scope) {}

  async answer(message: ToWorker): Promise<void> {
    if (message.type === "start") {
      this.core = await WebAssembly.compile(await bytesOf(message.core));
      await this.restart();
      this.scope.postMessage({ type: "started" }, []);
    } else if (message.type === "forget") this.decoder?.forget(message.file);
    else await this.decode(message.id, message.job);
  }

  private async decode(id: number, job: DecodeJob): Promise<void> {
    const start = performance.now();
    const damage: Damage[] = [];
    try {
      if (this.decoder === null) throw new Error("a job before the start");
      const packed = this.decoder.decode(job, (found) => damage.push(found));
      const message: FromWorker = { type: "decoded", id, packed, damage, ms: performance.now() - start };
      this.scope.postMessage(message, packed === null ? [] : (buffersOf(packed) as Transferable[]));
    } catch (error) {
      const told = error instanceof Error ? error.message : String(error);
      if (error instanceof CoreStopped || error instanceof WebAssembly.RuntimeError) await this.restart();
      // Where a companion stopped the core, the chunk is sound: it may come again without that.
      this.scope.postMessage({ type: "failed", id, message: told, damage, missingState: error instanceof MissingState || damage.length > 0 }, []);
    }
  }

  /** A new instance; what was kept is gone with the old one. */
  private async restart(): Promise<void> {
    if (this.core !== null) this.decoder = new ChunkDecoder(await Core.create(this.core));
  }
}

async function bytesOf(source: ArrayBuffer | string): Promise<ArrayBuffer> {
  if (typeof source !== "string") return source;
  const response = await fetch(source);
  if (!response.ok) throw new Error(`${source}: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}
