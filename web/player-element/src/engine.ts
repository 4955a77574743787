// The real engine: recordings come from the network or from files, workers decode them, three.js draws them.

import { importFile, openWorker, plainOf, Players, type Player, type Source, type WorkerFiles } from "@meshreel/player-core";
import type { OrderWorker } from "@meshreel/player-three";
import { GraphicsError } from "./stage.ts";
import type { Engine, Settings, Stage } from "./stage.ts";
import type { ThreeStage } from "./stage_three.ts";

/** Address of the built player's other files. */
export interface Files extends WorkerFiles {
  readonly order: URL; // the worker that orders splats
  readonly three: URL; // stage_three.ts and three.js: the largest part, which a player needs only with its first picture
}

export class RealEngine implements Engine {
  readonly #files: Files;
  readonly #players: Players;
  #stages: { readonly ThreeStage: typeof ThreeStage } | null = null;
  #loading: Promise<void> | null = null;

  constructor(files: Files) {
    this.#files = files;
    this.#players = new Players(files);
  }

  open(source: string | Blob | Source, { layers, interpolate, textures, splats, loop, direction, playbackRate, muted, volume, crossOrigin }: Settings): Player {
    const player = this.#players.open(source, crossOrigin);
    Object.assign(player.sound, { muted, volume });
    Object.assign(player, { layers, interpolate, textures, splats, loop, direction, playbackRate });
    player.load().catch(() => undefined); // reported by the error event
    return player;
  }

  load(): Promise<void> | null {
    if (this.#stages !== null) return null;
    return (this.#loading ??= this.#import(this.#files.three));
  }

  async #import(file: URL): Promise<void> {
    try {
      this.#stages = await importFile<typeof import("./stage_three.ts")>(file);
    } catch (error) {
      this.#loading = null; // to be tried again
      throw new Error(`${plainOf(file).href} cannot be loaded; load the page again`, { cause: error });
    }
  }

  stage(canvas: HTMLCanvasElement): Stage {
    try {
      return new this.#stages!.ThreeStage(canvas, () => openWorker(this.#files.order) as OrderWorker);
    } catch (error) {
      throw new GraphicsError(error instanceof Error ? error.message : String(error), { cause: error });
    }
  }
}
