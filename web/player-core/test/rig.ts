// A player with stand-ins for the network, the workers and the display, on a clock that the tests turn.

import { afterEach, beforeEach, expect, vi } from "vitest";

import { Player } from "../src/player.ts";
import type { PlayerOptions } from "../src/player.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { SlowSource } from "./slow_source.ts";
import { Viewer } from "./viewer.ts";

export class Rig {
  workers = new FakeWorkers();
  source!: SlowSource;
  player!: Player;
  viewer!: Viewer;

  begin(file: Uint8Array, bytesPerSecond: number, options: Partial<PlayerOptions> & { readonly count?: number } = {}): void {
    const { count = 2, ...others } = options;
    this.source = new SlowSource(file, bytesPerSecond);
    this.player = new Player({ source: this.source, workers: this.workers.setup(count), ...others });
    this.viewer = new Viewer(this.player, file);
  }

  /** Disposes of the player; everything must be released, and no law of a picture or of a worker's protocol broken. */
  end(): void {
    this.viewer.stop();
    this.player.dispose();
    vi.useRealTimers();
    expect(this.workers.offences).toEqual([]);
    expect(this.viewer.offences).toEqual([]);
    expect(this.viewer.alive.size).toBe(0);
    expect(this.workers.workers.every(({ isTerminated }) => isTerminated)).toBe(true);
  }
}

/** A rig that is made anew for each test of a file. */
export function useRig(): Rig {
  const rig = new Rig();
  beforeEach(() => {
    vi.useFakeTimers();
    rig.workers = new FakeWorkers();
  });
  afterEach(() => rig.end());
  return rig;
}

export async function pass(seconds: number): Promise<void> {
  await vi.advanceTimersByTimeAsync(seconds * 1000);
}

/** Frame numbers from one up to another. */
export function frames(first: number, behind: number): number[] {
  return Array.from({ length: behind - first }, (_, k) => first + k);
}
