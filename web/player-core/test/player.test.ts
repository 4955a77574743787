// Playback with stand-ins for the network and the workers, on a clock that the tests turn.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import type { Player } from "../src/player.ts";
import type { FakeWorkers } from "./fake_workers.ts";
import { group, makeReel, stream } from "./reel.ts";
import { Rig, frames, pass } from "./rig.ts";
import type { SlowSource } from "./slow_source.ts";
import type { Viewer } from "./viewer.ts";

const FULL = [4000, 8000, 16000, 32000]; // bytes a second of each layer: 60 000 in all
const RATE = 60_000;

let rig: Rig;
let workers: FakeWorkers;
let source: SlowSource;
let player: Player;
let viewer: Viewer;

beforeEach(() => {
  vi.useFakeTimers();
  rig = new Rig();
  workers = rig.workers;
});

afterEach(() => rig.end());

function begin(...told: Parameters<Rig["begin"]>): void {
  rig.begin(...told);
  ({ source, player, viewer } = rig);
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
    expect(viewer.frames).toEqual(frames(0, 100));
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

  test("fetches so many seconds ahead and no more, whatever the network gives", async () => {
    begin(stream(120, FULL), 100 * RATE, { bufferSeconds: 6 });
    void player.load();
    await pass(10);
    expect(source.sentBytes).toBeGreaterThan(0.75 * 6 * RATE);
    expect(source.sentBytes).toBeLessThan(6.5 * RATE + 16384);
    const before = source.sentBytes;
    await Promise.all([player.play(), pass(20)]);
    expect(source.sentBytes - before).toBeGreaterThan(18 * RATE);
    expect(source.sentBytes - before).toBeLessThan(22 * RATE);
  });

  test("fetches nothing twice", async () => {
    const file = stream(20, FULL, 5);
    begin(file, 3 * RATE);
    await Promise.all([player.play(), pass(25)]);
    expect(viewer.events).toContain("ended");
    expect(source.sentBytes).toBe(file.length);
  });

  test("asks for groups that lie together in one request", async () => {
    begin(stream(80, [2000]), 100_000);
    await Promise.all([player.play(), pass(85)]);
    expect(viewer.frames).toHaveLength(2000);
    expect(source.reads.length).toBeLessThan(35); // of 200 groups: one for each quarter of ten seconds
  });

  test("keeps time at any rate, told by the display's clock and not by its pictures", async () => {
    begin(stream(20, FULL), 100 * RATE);
    await Promise.all([player.play(), pass(0.5)]);
    for (const rate of [0.5, 2, 4]) {
      player.playbackRate = rate;
      const time = player.currentTime;
      await pass(2);
      expect(player.currentTime - time).toBeCloseTo(2 * rate, 1);
    }
    expect(player.stats.stalls).toBe(0);
    expect(viewer.count("ratechange")).toBe(3);
  });

  test("stands still while paused, and goes on without a jump", async () => {
    begin(stream(20, FULL), 100 * RATE);
    await Promise.all([player.play(), pass(1)]);
    player.pause();
    const time = player.currentTime;
    viewer.stop(); // as a page may: no pictures are asked for
    await pass(100);
    await Promise.all([player.play(), pass(0.1)]);
    viewer.look();
    await pass(0.1);
    viewer.look();
    expect(player.currentTime - time).toBeCloseTo(0.1, 3);
  });

  test("breaks the promise of play where a pause comes first", async () => {
    begin(stream(20, FULL), RATE);
    const started = player.play();
    player.pause();
    await expect(started).rejects.toMatchObject({ name: "AbortError" });
    await pass(5);
    expect(viewer.events).not.toContain("playing");
    expect(player.currentTime).toBe(0);
  });

  test("plays once more from the start after the end", async () => {
    begin(stream(2, FULL), 100 * RATE);
    await Promise.all([player.play(), pass(3)]);
    expect(player.ended).toBe(true);
    await Promise.all([player.play(), pass(3)]);
    expect(viewer.frames).toEqual([...frames(0, 50), ...frames(0, 50)]);
    expect(viewer.count("ended")).toBe(2);
  });

  test("shows frames at variable intervals at their own times", async () => {
    const intervals = Array.from({ length: 49 }, (_, k) => (k % 2 ? 100_000 : 20_000));
    begin(makeReel(Array.from({ length: 5 }, () => group(10, [500])), { frameRate: 25, intervals }), 100 * RATE);
    await Promise.all([player.play(), pass(0.3)]);
    const seen = new Map<number, number>();
    for (let k = 0; k < 300; k++) {
      await pass(0.01);
      if (viewer.shown) seen.set(viewer.shown.frame, (seen.get(viewer.shown.frame) ?? 0) + 1);
    }
    for (let frame = 10; frame < 40; frame++) {
      expect(seen.get(frame)! / 100).toBeGreaterThan(frame % 2 ? 0.06 : 0.0);
      expect(seen.get(frame)! / 100).toBeLessThan(frame % 2 ? 0.14 : 0.06);
    }
  });

  test("blends towards the next frame within a group, and not across its border", async () => {
    begin(stream(4, [500]), 100 * RATE);
    await Promise.all([player.play(), pass(0.5)]);
    const blends = new Map<number, number[]>();
    for (let k = 0; k < 100; k++) {
      await pass(1 / 60);
      const { frame, blend } = viewer.shown!;
      blends.set(frame, [...(blends.get(frame) ?? []), blend]);
    }
    for (const [frame, values] of blends) {
      if (frame % 10 === 9) expect(values.every((blend) => blend === 0)).toBe(true);
      else expect(values).toEqual([...values].sort((a, b) => a - b));
    }
    expect([...blends.values()].flat().filter((blend) => blend > 0.1 && blend < 0.9).length).toBeGreaterThan(50);
    player.interpolate = false;
    await pass(1 / 30);
    for (let k = 0; k < 30; k++) {
      await pass(1 / 60);
      expect(viewer.shown!.blend).toBe(0);
    }
  });

  test("gives the same object while nothing changes, another one when something does", async () => {
    begin(stream(4, FULL), 100 * RATE);
    void player.load();
    await pass(1);
    viewer.stop();
    const first = player.update(performance.now());
    expect(player.update(performance.now() + 1)).toBe(first);
    player.step(1);
    await pass(0.1);
    const second = player.update(performance.now());
    expect(second).not.toBe(first);
    expect([first!.frame, second!.frame]).toEqual([0, 1]); // so that a renderer can compare the last two
  });
});

describe("a stall", () => {
  test("holds time at a group's border, is told, and ends when enough is at hand", async () => {
    begin(stream(20, FULL), 100 * RATE, { bufferSeconds: 2 });
    player.quality = 3;
    await Promise.all([player.play(), pass(1)]);
    source.bytesPerSecond = 1;
    await pass(5);
    expect(viewer.events.slice(-1)).toEqual(["waiting"]);
    expect(player.stats).toMatchObject({ stalls: 1, bufferedSeconds: expect.closeTo(0, 1) as number });
    const held = player.currentTime;
    expect(viewer.shown!.frame % 10).toBe(9);
    await pass(5);
    expect(player.currentTime).toBe(held);
    expect(player.paused).toBe(false);
    source.bytesPerSecond = 10 * RATE;
    await pass(1);
    expect(viewer.events.slice(-1)).toEqual(["playing"]);
    await pass(20);
    expect(viewer.frames).toEqual(frames(0, 500));
    expect(player.stats.stalls).toBe(1);
  });
});

describe("a loop", () => {
  test("is played without a stall, and every frame in it", async () => {
    begin(stream(8, FULL, 5), 2 * RATE, { bufferSeconds: 3, decodedSeconds: 2 });
    workers.msOf = () => 60;
    player.loop = true;
    await Promise.all([player.play(), pass(30)]);
    expect(player.stats.stalls).toBe(0);
    expect(viewer.frames.slice(0, 600)).toEqual([...frames(0, 200), ...frames(0, 200), ...frames(0, 200)]);
    expect(viewer.events).not.toContain("ended");
  });

  test("of twenty rounds takes no more memory than the first", async () => {
    begin(stream(12, FULL, 5), 3 * RATE, { bufferSeconds: 3, decodedSeconds: 2 });
    player.loop = true;
    await Promise.all([player.play(), pass(12)]);
    const most = viewer.mostAlive;
    expect(most).toBeLessThan(13); // of 30 groups: 2 s ahead, 1 s behind, and what is being changed
    viewer.mostAlive = 0;
    await pass(240);
    expect(viewer.frames.length).toBeGreaterThan(6000);
    expect(viewer.mostAlive).toBeLessThanOrEqual(most + 1);
    expect(player.stats.stalls).toBe(0);
  });

  test("that fits into the buffer is fetched and decoded once", async () => {
    const file = stream(2, FULL, 5);
    begin(file, 3 * RATE);
    player.loop = true;
    await Promise.all([player.play(), pass(40)]);
    expect(source.sentBytes).toBe(file.length);
    expect(workers.chunks.sort()).toEqual([0, 1, 2, 3, 4]);
    expect(viewer.frames.length).toBeGreaterThan(950);
  });

  test("that is switched off ends at the end", async () => {
    begin(stream(2, FULL), 30 * RATE);
    player.loop = true;
    await Promise.all([player.play(), pass(5)]);
    player.loop = false;
    await pass(3);
    expect(player.ended).toBe(true);
  });
});

describe("memory", () => {
  test("is kept to by decoding less far ahead", async () => {
    workers.bytesPerFrame = 100_000; // 1 MB a group
    begin(stream(60, FULL), 20 * RATE, { memory: 5e6, decodedSeconds: 10 });
    await Promise.all([player.play(), pass(30)]);
    expect(player.stats.stalls).toBe(0);
    expect(viewer.mostAlive).toBeLessThanOrEqual(5 + 4); // ahead, and those that are kept behind
    expect(viewer.mostAlive).toBeGreaterThan(3);
  });

  test("too small for a group plays all the same: the shown and the next are always there", async () => {
    workers.bytesPerFrame = 100_000;
    begin(stream(10, FULL), 20 * RATE, { memory: 1, decodedSeconds: 10 });
    await Promise.all([player.play(), pass(12)]);
    expect(viewer.frames).toEqual(frames(0, 250));
    expect(viewer.mostAlive).toBeLessThanOrEqual(6);
  });
});
