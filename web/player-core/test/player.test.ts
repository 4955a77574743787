// Playback with stand-ins for the network and the workers, on a clock that the tests turn.

import { describe, expect, test } from "vitest";

import { group, makeReel, stream } from "./reel.ts";
import { frames, pass, useRig } from "./rig.ts";

const FULL = [4000, 8000, 16000, 32000]; // bytes a second of each layer: 60 000 in all
const RATE = 60_000;

const rig = useRig();

describe("playing", () => {
  test("shows every frame once, in order, at its time, and ends", async () => {
    rig.begin(stream(4, FULL), 10 * RATE);
    const started = rig.player.play();
    await pass(1);
    await started;
    const [time, now] = [rig.player.currentTime, performance.now()];
    await pass(2);
    expect(rig.player.currentTime - time).toBeCloseTo((performance.now() - now) / 1000, 1);
    await pass(3);
    expect(rig.viewer.frames).toEqual(frames(0, 100));
    expect(rig.viewer.events.filter((event) => event !== "layerschange")).toEqual(
      ["play", "waiting", "loadedmetadata", "canplay", "playing", "pause", "ended"],
    );
    expect(rig.player).toMatchObject({ ended: true, paused: true, currentTime: 4, duration: 4, currentFrame: 99 });
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("shows the first frame long before the file is there", async () => {
    rig.begin(stream(60, FULL), RATE);
    void rig.player.load();
    await pass(1.5);
    expect(rig.viewer.shown?.frame).toBe(0);
    expect(rig.source.sentBytes).toBeLessThan(60 * RATE * 0.05);
    expect(rig.viewer.events).toContain("canplay");
  });

  test("fetches so many seconds ahead and no more, whatever the network gives", async () => {
    rig.begin(stream(120, FULL), 100 * RATE, { bufferSeconds: 6 });
    rig.player.layers = 3;
    void rig.player.load();
    await pass(10);
    expect(rig.source.sentBytes).toBeGreaterThan(0.75 * 6 * RATE);
    expect(rig.source.sentBytes).toBeLessThan(6.5 * RATE + 16384);
    const before = rig.source.sentBytes;
    await Promise.all([rig.player.play(), pass(20)]);
    expect(rig.source.sentBytes - before).toBeGreaterThan(18 * RATE);
    expect(rig.source.sentBytes - before).toBeLessThan(22 * RATE);
  });

  test("fetches a file of some megabytes whole while it stands, a larger one no further ahead than it plays", async () => {
    for (const [seconds, most] of [[120, 120.1], [600, 10.5]] as const) {
      rig.begin(stream(seconds, FULL), 100 * RATE);
      void rig.player.load();
      await pass(10);
      expect(rig.source.sentBytes).toBeGreaterThan(Math.min(0.7 * most, 120) * RATE);
      expect(rig.source.sentBytes).toBeLessThan(most * RATE + 65_536);
      rig.viewer.stop();
      rig.player.dispose();
    }
  });

  test("fetches nothing twice", async () => {
    const file = stream(20, FULL, 5);
    rig.begin(file, 3 * RATE);
    await Promise.all([rig.player.play(), pass(25)]);
    expect(rig.viewer.events).toContain("ended");
    expect(rig.source.sentBytes).toBe(file.length);
  });

  test("asks for groups that lie together in one request", async () => {
    rig.begin(stream(80, [2000]), 100_000);
    await Promise.all([rig.player.play(), pass(85)]);
    expect(rig.viewer.frames).toHaveLength(2000);
    expect(rig.source.reads.length).toBeLessThan(35); // of 200 groups: one for each quarter of ten seconds
  });

  test("keeps time at any rate, told by the display's clock and not by its pictures", async () => {
    rig.begin(stream(20, FULL), 100 * RATE);
    await Promise.all([rig.player.play(), pass(0.5)]);
    for (const rate of [0.5, 2, 4]) {
      rig.player.playbackRate = rate;
      const time = rig.player.currentTime;
      await pass(2);
      expect(rig.player.currentTime - time).toBeCloseTo(2 * rate, 1);
    }
    expect(rig.player.stats.stalls).toBe(0);
    expect(rig.viewer.count("ratechange")).toBe(3);
  });

  test("stands still while paused, and goes on without a jump", async () => {
    rig.begin(stream(20, FULL), 100 * RATE);
    await Promise.all([rig.player.play(), pass(1)]);
    rig.player.pause();
    const time = rig.player.currentTime;
    rig.viewer.stop(); // as a page may: no pictures are asked for
    await pass(100);
    await Promise.all([rig.player.play(), pass(0.1)]);
    rig.viewer.look();
    await pass(0.1);
    rig.viewer.look();
    expect(rig.player.currentTime - time).toBeCloseTo(0.1, 3);
  });

  test("breaks the promise of play where a pause comes first", async () => {
    rig.begin(stream(20, FULL), RATE);
    const started = rig.player.play();
    rig.player.pause();
    await expect(started).rejects.toMatchObject({ name: "AbortError" });
    await pass(5);
    expect(rig.viewer.events).not.toContain("playing");
    expect(rig.player.currentTime).toBe(0);
  });

  test("plays once more from the start after the end", async () => {
    rig.begin(stream(2, FULL), 100 * RATE);
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.player.ended).toBe(true);
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.frames).toEqual([...frames(0, 50), ...frames(0, 50)]);
    expect(rig.viewer.count("ended")).toBe(2);
  });

  test("shows frames at variable intervals at their own times", async () => {
    const intervals = Array.from({ length: 49 }, (_, k) => (k % 2 ? 100_000 : 20_000));
    rig.begin(makeReel(Array.from({ length: 5 }, () => group(10, [500])), { frameRate: 25, intervals }), 100 * RATE);
    await Promise.all([rig.player.play(), pass(0.3)]);
    const seen = new Map<number, number>();
    for (let k = 0; k < 300; k++) {
      await pass(0.01);
      if (rig.viewer.shown) seen.set(rig.viewer.shown.frame, (seen.get(rig.viewer.shown.frame) ?? 0) + 1);
    }
    for (let frame = 10; frame < 40; frame++) {
      expect(seen.get(frame)! / 100).toBeGreaterThan(frame % 2 ? 0.06 : 0.0);
      expect(seen.get(frame)! / 100).toBeLessThan(frame % 2 ? 0.14 : 0.06);
    }
  });

  test("blends towards the next frame within a group, and not across its border", async () => {
    rig.begin(stream(4, [500]), 100 * RATE);
    await Promise.all([rig.player.play(), pass(0.5)]);
    const blends = new Map<number, number[]>();
    for (let k = 0; k < 100; k++) {
      await pass(1 / 60);
      const { frame, blend } = rig.viewer.shown!;
      blends.set(frame, [...(blends.get(frame) ?? []), blend]);
    }
    for (const [frame, values] of blends) {
      if (frame % 10 === 9) expect(values.every((blend) => blend === 0)).toBe(true);
      else expect(values).toEqual([...values].sort((a, b) => a - b));
    }
    expect([...blends.values()].flat().filter((blend) => blend > 0.1 && blend < 0.9).length).toBeGreaterThan(50);
    rig.player.interpolate = false;
    await pass(1 / 30);
    for (let k = 0; k < 30; k++) {
      await pass(1 / 60);
      expect(rig.viewer.shown!.blend).toBe(0);
    }
  });

  test("gives the same object while nothing changes, another one when something does", async () => {
    rig.begin(stream(4, FULL), 100 * RATE);
    void rig.player.load();
    await pass(1);
    rig.viewer.stop();
    const first = rig.player.update(performance.now());
    expect(rig.player.update(performance.now() + 1)).toBe(first);
    rig.player.step(1);
    await pass(0.1);
    const second = rig.player.update(performance.now());
    expect(second).not.toBe(first);
    expect([first!.frame, second!.frame]).toEqual([0, 1]); // so that a renderer can compare the last two
  });
});

describe("a stall", () => {
  test("holds time at a group's border, is told, and ends when enough is at hand", async () => {
    rig.begin(stream(20, FULL), 100 * RATE, { bufferSeconds: 2 });
    rig.player.layers = 3;
    await Promise.all([rig.player.play(), pass(1)]);
    rig.source.bytesPerSecond = 1;
    await pass(5);
    expect(rig.viewer.events.slice(-1)).toEqual(["waiting"]);
    expect(rig.player.stats).toMatchObject({ stalls: 1, bufferedSeconds: expect.closeTo(0, 1) as number });
    const held = rig.player.currentTime;
    expect(rig.viewer.shown!.frame % 10).toBe(9);
    await pass(5);
    expect(rig.player.currentTime).toBe(held);
    expect(rig.player.paused).toBe(false);
    rig.source.bytesPerSecond = 10 * RATE;
    await pass(1);
    expect(rig.viewer.events.slice(-1)).toEqual(["playing"]);
    await pass(20);
    expect(rig.viewer.frames).toEqual(frames(0, 500));
    expect(rig.player.stats.stalls).toBe(1);
  });
});

describe("backwards", () => {
  test("every frame is shown from the last to the first, chains or not, and again from the last", async () => {
    rig.begin(stream(20, FULL, 5), 3 * RATE);
    rig.player.direction = "reverse";
    await Promise.all([rig.player.play(), pass(25)]);
    expect(rig.viewer.frames).toEqual(frames(0, 500).reverse());
    expect([rig.viewer.events.at(-1), rig.player.stats.stalls, rig.player.currentTime]).toEqual(["ended", 0, 0]);
    await Promise.all([rig.player.play(), pass(1)]);
    expect(rig.player.currentFrame).toBeGreaterThan(470);
  });

  test("a loop that turns shows every frame on both ways, and waits at no turn", async () => {
    rig.begin(stream(4, FULL, 5), 3 * RATE);
    Object.assign(rig.player, { direction: "alternate", loop: true });
    await Promise.all([rig.player.play(), pass(9.5)]);
    const round = [...frames(0, 100), ...frames(1, 99).reverse()];
    expect(rig.viewer.frames.slice(0, round.length + 20)).toEqual([...round, ...frames(0, 20)]);
    expect([rig.player.stats.stalls, rig.player.paused]).toEqual([0, false]);
  });
});

describe("a loop", () => {
  test("is played without a stall, and every frame in it", async () => {
    rig.begin(stream(8, FULL, 5), 2 * RATE, { bufferSeconds: 3, decodedSeconds: 2 });
    rig.workers.msOf = () => 60;
    rig.player.loop = true;
    await Promise.all([rig.player.play(), pass(30)]);
    expect(rig.player.stats.stalls).toBe(0);
    expect(rig.viewer.frames.slice(0, 600)).toEqual([...frames(0, 200), ...frames(0, 200), ...frames(0, 200)]);
    expect(rig.viewer.events).not.toContain("ended");
  });

  test("of twenty rounds takes no more memory than the first", async () => {
    rig.begin(stream(12, FULL, 5), 3 * RATE, { bufferSeconds: 3, decodedSeconds: 2 });
    rig.player.loop = true;
    await Promise.all([rig.player.play(), pass(12)]);
    const most = rig.viewer.mostAlive;
    expect(most).toBeLessThan(13); // of 30 groups: 2 s ahead, 1 s behind, and what is being changed
    rig.viewer.mostAlive = 0;
    await pass(240);
    expect(rig.viewer.frames.length).toBeGreaterThan(6000);
    expect(rig.viewer.mostAlive).toBeLessThanOrEqual(most + 1);
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("that fits into the buffer is fetched once, and decoded until it is whole", async () => {
    const file = stream(2, FULL, 5);
    rig.begin(file, 3 * RATE);
    rig.player.loop = true;
    await Promise.all([rig.player.play(), pass(40)]);
    expect(rig.source.sentBytes).toBe(file.length);
    expect(new Set(rig.workers.chunks)).toEqual(new Set([0, 1, 2, 3, 4]));
    expect(rig.workers.chunks.length).toBeLessThan(10); // some with the layers that came first, and again with all
    expect(rig.viewer.frames.length).toBeGreaterThan(950);
  });

  test("that is switched off ends at the end", async () => {
    rig.begin(stream(2, FULL), 30 * RATE);
    rig.player.loop = true;
    await Promise.all([rig.player.play(), pass(5)]);
    rig.player.loop = false;
    await pass(3);
    expect(rig.player.ended).toBe(true);
  });
});

describe("memory", () => {
  test("is kept to by decoding less far ahead", async () => {
    rig.workers.bytesPerFrame = 100_000; // 1 MB a group
    rig.begin(stream(60, FULL), 20 * RATE, { memory: 5e6, decodedSeconds: 10 });
    await Promise.all([rig.player.play(), pass(30)]);
    expect(rig.player.stats.stalls).toBe(0);
    expect(rig.viewer.mostAlive).toBeLessThanOrEqual(5 + 4); // ahead, and those that are kept behind
    expect(rig.viewer.mostAlive).toBeGreaterThan(3);
  });

  test("too small for a group plays all the same: the shown and the next are always there", async () => {
    rig.workers.bytesPerFrame = 100_000;
    rig.begin(stream(10, FULL), 20 * RATE, { memory: 1, decodedSeconds: 10 });
    await Promise.all([rig.player.play(), pass(12)]);
    expect(rig.viewer.frames).toEqual(frames(0, 250));
    expect(rig.viewer.mostAlive).toBeLessThanOrEqual(6);
  });
});
