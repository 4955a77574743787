// The real engine: recordings come from the network or from files, workers decode them, three.js draws them.

import { BlobSource, HttpSource, Player } from "@meshreel/player-core";
import type { WorkerLike } from "@meshreel/player-core";
import type { Engine, Settings, Stage } from "./stage.ts";
import { ThreeStage } from "./stage_three.ts";

/** Where the built player's other files lie. */
export interface Files {
  readonly worker: URL;
  readonly core: URL;
  readonly draco: URL;
}

export class RealEngine implements Engine {
  readonly #files: Files;

  constructor(files: Files) {
    this.#files = files;
  }

  open(source: string | Blob, { quality, interpolate, loop, playbackRate }: Settings): Player {
    const { core, draco } = this.#files;
    const player = new Player({
      source: typeof source === "string" ? new HttpSource(source) : new BlobSource(source),
      workers: { create: () => openWorker(this.#files.worker), core: core.href, draco: draco.href },
    });
    Object.assign(player, { quality, interpolate, loop, playbackRate });
    player.load().catch(() => undefined); // its error event tells
    return player;
  }

  stage(canvas: HTMLCanvasElement): Stage {
    return new ThreeStage(canvas);
  }
}

/**
 * A worker of a module. Browsers start workers only from the page's own origin: of any other, a worker made here imports the module,
 * which that origin must allow by CORS.
 */
export function openWorker(module: URL): WorkerLike {
  if (module.origin === location.origin) return new Worker(module, { type: "module" }) as WorkerLike;
  const address = URL.createObjectURL(new Blob([`import ${JSON.stringify(module.href)};`], { type: "text/javascript" }));
  const worker = new Worker(address, { type: "module" });
  // The address is needed until the worker has read it, and a worker does not tell when; it answers its first message after that.
  worker.addEventListener("message", () => URL.revokeObjectURL(address), { once: true });
  return worker as WorkerLike;
}
