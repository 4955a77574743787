// The real engine: recordings come from the network or from files, workers decode them, three.js draws them.

import { BlobSource, HttpSource, Player, WorkerPool, type WorkerLike } from "@meshreel/player-core";
import type { OrderWorker } from "@meshreel/player-three";
import { GraphicsError } from "./stage.ts";
import type { Engine, Settings, Stage } from "./stage.ts";
import type { ThreeStage } from "./stage_three.ts";

/** Where the built player's other files lie. */
export interface Files {
  readonly worker: URL;
  readonly core: URL;
  readonly draco: URL;
  readonly order: URL; // the worker that orders splats
  readonly three: URL; // stage_three.ts and three.js: the largest part, which a player needs only with its first picture
}

const POOL_KEPT = 1000; // ms that workers are kept after the last player is closed: a change of `src` needs them again

/** Workers, and how many players use them. */
interface Shared {
  readonly workers: WorkerPool;
  users: number;
}

export class RealEngine implements Engine {
  readonly #files: Files;
  #shared: Shared | null = null; // what the next player gets
  #stages: { readonly ThreeStage: typeof ThreeStage } | null = null;
  #loading: Promise<void> | null = null;

  constructor(files: Files) {
    this.#files = files;
  }

  open(source: string | Blob, { layers, interpolate, textures, splats, loop, playbackRate, muted, volume, crossOrigin }: Settings): Player {
    const { worker, core, draco } = this.#files;
    const create = (): WorkerLike => openWorker(worker) as WorkerLike;
    const shared = (this.#shared ??= { workers: new WorkerPool({ create, core: bytesOf(core), draco: bytesOf(draco) }), users: 0 });
    shared.users++;
    const player = new PooledPlayer({
      source: typeof source === "string" ? new HttpSource(source, { credentials: crossOrigin === "use-credentials" ? "include" : "same-origin" }) : new BlobSource(source),
      workers: shared.workers,
    });
    player.leave = () => this.#leave(shared);
    // Workers that could not be started are not tried again by their pool: whoever tries again gets new ones.
    player.addEventListener("error", () => this.#forget(shared));
    Object.assign(player.sound, { muted, volume });
    Object.assign(player, { layers, interpolate, textures, splats, loop, playbackRate });
    player.load().catch(() => undefined); // reported by the error event
    return player;
  }

  load(): Promise<void> | null {
    if (this.#stages !== null) return null;
    return (this.#loading ??= this.#import(this.#files.three.href));
  }

  async #import(address: string): Promise<void> {
    try {
      this.#stages = (await import(/* @vite-ignore */ address)) as typeof import("./stage_three.ts");
    } catch (error) {
      this.#loading = null; // to be tried again
      throw new Error(`${address} cannot be loaded; load the page again`, { cause: error });
    }
  }

  stage(canvas: HTMLCanvasElement): Stage {
    try {
      return new this.#stages!.ThreeStage(canvas, () => openWorker(this.#files.order) as OrderWorker);
    } catch (error) {
      throw new GraphicsError(error instanceof Error ? error.message : String(error), { cause: error });
    }
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

/** A file's bytes, once for all workers; its address where they do not come, so that a worker tells why. */
function bytesOf(file: URL): Promise<ArrayBuffer | string> {
  return fetch(file).then<ArrayBuffer | string>((response) => (response.ok ? response.arrayBuffer() : file.href)).catch(() => file.href);
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

/**
 * A worker of a module. Browsers start workers only from the page's own origin, or from what it has in memory: of any other, a worker made here imports the module,
 * which that origin must allow by CORS.
 */
export function openWorker(module: URL): Worker {
  if (module.protocol === "blob:") return new Worker(module); // as a classic script, which it is too: a page on disk may load no module
  if (module.origin === location.origin) return new Worker(module, { type: "module" });
  const address = URL.createObjectURL(new Blob([`import ${JSON.stringify(module.href)};`], { type: "text/javascript" }));
  const worker = new Worker(address, { type: "module" });
  // The address is needed until the worker has read it, and a worker does not report when; it answers its first message after that.
  worker.addEventListener("message", () => URL.revokeObjectURL(address), { once: true });
  return worker;
}
