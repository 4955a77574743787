// One playback of one file, under a trace: what the network gave, and what was seen of it.

import type { Playback, Shown } from "@meshreel/player-core/types";

export class Showing {
  #opened = 0; // ms
  #started = NaN;
  #waits = NaN; // ms, since when it stalls
  #stalled = 0; // ms
  #playback: Playback | null = null;
  readonly #layers: Map<number, number>[] = []; // of each track, by first frame of a group, in its first picture
  readonly #frames: Map<number, number>[] = []; // of these groups

  /** Begins with the opening. The playback is watched from within: nothing else sees every picture that it gives. */
  watch(playback: Playback): void {
    this.#opened = performance.now();
    this.#playback = playback;
    playback.addEventListener("playing", () => {
      const now = performance.now();
      if (Number.isNaN(this.#started)) this.#started = now;
      if (!Number.isNaN(this.#waits)) this.#stalled += now - this.#waits;
      this.#waits = NaN;
    });
    playback.addEventListener("waiting", () => {
      if (!Number.isNaN(this.#started)) this.#waits = performance.now();
    });
    const update = playback.update.bind(playback);
    playback.update = (now, far) => {
      const shown = update(now, far);
      if (shown && !playback.paused && !Number.isNaN(this.#started)) this.#see(shown);
      return shown;
    };
  }

  /** Columns of the CSV, to be asked for when it ends. Layers are counted beyond the first. */
  result(): Result {
    const { stalls, fetchedBytes } = this.#playback!.stats;
    const groups = this.#layers.flatMap((layers, track) => [...layers].map(([frame, count]) => ({ count, frames: this.#frames[track]!.get(frame)! })));
    const frames = groups.reduce((sum, group) => sum + group.frames, 0);
    const sorted = this.#layers.map((layers) => [...layers].sort(([one], [other]) => one - other).map((entry) => entry.join(":")).join(" "));
    return {
      start_s: ((this.#started - this.#opened) / 1000).toFixed(3),
      stalls,
      stalled_s: (this.#stalled / 1000).toFixed(3),
      layers: (groups.reduce((sum, group) => sum + group.count * group.frames, 0) / Math.max(1, frames)).toFixed(3),
      layers_by_group: sorted.join(" | "),
      bytes: fetchedBytes,
    };
  }

  #see({ groups }: Shown): void {
    groups.forEach((group, track) => {
      const layers = (this.#layers[track] ??= new Map<number, number>());
      const frames = (this.#frames[track] ??= new Map<number, number>());
      if (group === null || layers.has(group.firstFrame)) return;
      layers.set(group.firstFrame, group.layers);
      frames.set(group.firstFrame, group.frameCount);
    });
  }
}

export interface Result {
  readonly start_s: string; // from opening to playing
  readonly stalls: number;
  readonly stalled_s: string;
  readonly layers: string; // mean over frames and bodies
  readonly layers_by_group: string; // first frame and layers of each group that was seen; bodies are apart by a bar
  readonly bytes: number; // that had come when it ended
}

export const RESULTS: readonly (keyof Result)[] = ["start_s", "stalls", "stalled_s", "layers", "layers_by_group", "bytes"];
