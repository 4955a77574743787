// Playback with stand-ins for the network and the workers, on a clock that the tests turn.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { Player } from "../src/player.ts";
import type { PlayerOptions } from "../src/player.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { stream } from "./reel.ts";
import { SlowSource } from "./slow_source.ts";
import { Viewer } from "./viewer.ts";

const FULL = [4000, 8000, 16000, 32000]; // bytes a second of each layer: 60 000 in all
const RATE = 60_000;

let workers: FakeWorkers;
let source: SlowSource;
let player: Player;
let viewer: Viewer;

beforeEach(() => {
  vi.useFakeTimers();
  workers = new FakeWorkers();
});

afterEach(() => {
  viewer.stop();
  player.dispose();
  vi.useRealTimers();
  expect(workers.offences).toEqual([]);
  expect(viewer.offences).toEqual([]);
  expect(viewer.alive.size).toBe(0);
  expect(workers.workers.every(({ isTerminated }) => isTerminated)).toBe(true);
});

function begin(file: Uint8Array, bytesPerSecond: number, options: Partial<PlayerOptions> = {}): void {
  source = new SlowSource(file, bytesPerSecond);
  player = new Player({ source, workers: workers.setup(2), ...options });
  viewer = new Viewer(player, file);
}

async function pass(seconds: number): Promise<void> {
  await vi.advanceTimersByTimeAsync(seconds * 1000);
}

describe("playing", () => {
  test("shows every frame once, in order, at its time, and ends", async () => {
    begin(stream(4, FULL), 10 * RATE);
    const started = player.play();
    await pass(1);
    await started;
    const [time, now] = [player.currentTime, performance.now()];
    await pass(2);
    expect(player.currentTime - time).toBeCloseTo((performance.now() - now) / 1000, 1);
    await pass(3);
    expect(viewer.frames).toEqual(Array.from({ length: 100 }, (_, frame) => frame));
    expect(viewer.events.filter((event) => event !== "qualitychange")).toEqual(
      ["play", "waiting", "loadedmetadata", "canplay", "playing", "pause", "ended"],
    );
    expect(player).toMatchObject({ ended: true, paused: true, currentTime: 4, duration: 4, currentFrame: 99 });
    expect(player.stats.stalls).toBe(0);
  });

  test("shows the first frame long before the file is there", async () => {
    begin(stream(60, FULL), RATE);
    void player.load();
    await pass(1.5);
    expect(viewer.shown?.frame).toBe(0);
    expect(source.sentBytes).toBeLessThan(60 * RATE * 0.05);
    expect(viewer.events).toContain("canplay");
  });
});
