// Opens recordings that share decoding workers.

import { bytesOf, plainOf } from "./net/built.ts";
import { BlobSource, type Source } from "./net/source.ts";
import { HttpSource } from "./net/http_source.ts";
import { Player } from "./player.ts";
import { WorkerPool, type WorkerLike } from "./time/pool.ts";

/** Addresses of the workers' files. */
export interface WorkerFiles {
  readonly worker: URL;
  readonly core: URL;
}

const POOL_KEPT = 1000; // ms that workers are kept after the last player is closed: a change of the source needs them again

/** Workers, and how many players use them. */
interface Shared {
  readonly workers: WorkerPool;
  users: number;
}

export class Players {
  readonly #files: WorkerFiles;
  #shared: Shared | null = null; // for the next player

  constructor(files: WorkerFiles) {
    this.#files = files;
  }

  /** A player of an address, a file or a source; `crossOrigin` as a video has it. */
  open(source: string | Blob | Source, crossOrigin: string | null): Player {
    const { worker, core } = this.#files;
    const create = (): WorkerLike => openWorker(worker) as WorkerLike;
    const shared = (this.#shared ??= { workers: new WorkerPool({ create, core: bytesAt(core) }), users: 0 });
    shared.users++;
    const player = new PooledPlayer({
      source: typeof source === "string" ? new HttpSource(source, { credentials: crossOrigin === "use-credentials" ? "include" : "same-origin" }) : source instanceof Blob ? new BlobSource(source) : source,
      workers: shared.workers,
    });
    player.leave = () => this.#leave(shared);
    // Workers that could not be started are not tried again by their pool: whoever tries again gets new ones.
    player.addEventListener("error", () => this.#forget(shared));
    return player;
  }

  #leave(shared: Shared): void {
    shared.users--;
    setTimeout(() => {
      if (shared.users > 0) return;
      this.#forget(shared);
      shared.workers.dispose();
    }, POOL_KEPT);
  }

  #forget(shared: Shared): void {
    if (this.#shared === shared) this.#shared = null;
  }
}

/** A player that reports when it no longer needs the pool. */
class PooledPlayer extends Player {
  leave: (() => void) | null = null;

  override dispose(): void {
    super.dispose();
    this.leave?.();
    this.leave = null;
  }
}

/** A file's bytes, once for all workers; its address where they do not come, so that a worker tells why. */
function bytesAt(file: URL): Promise<ArrayBuffer | string> {
  return bytesOf(file).catch(() => plainOf(file).href);
}

/**
 * A worker of a module. Browsers start workers only from the page's own origin, or from what it has in memory: of any other, a worker made here imports the module,
 * which that origin must allow by CORS.
 */
export function openWorker(module: URL): Worker {
  if (["blob:", "data:"].includes(module.protocol)) return new Worker(module); // as a classic script, which it is too: a page on disk may load no module
  if (module.origin === location.origin) return new Worker(module, { type: "module" });
  const address = URL.createObjectURL(new Blob([`import ${JSON.stringify(module.href)};`], { type: "text/javascript" }));
  const worker = new Worker(address, { type: "module" });
  // The address is needed until the worker has read it, and a worker does not report when; it answers its first message after that.
  worker.addEventListener("message", () => URL.revokeObjectURL(address), { once: true });
  return worker;
}
