// How many layers are played: as many as network and workers bear, without a frame less.

import { describe, expect, test } from "vitest";

import { slowTest } from "../../test/slow.ts";
import { group, makeReel, stream } from "./reel.ts";
import { frames, pass, useRig } from "./rig.ts";

const FULL = [4000, 8000, 16000, 32000]; // bytes a second of each layer
const RATE = 60_000; // of all
const BEST = 3;

const rig = useRig();

const seen = (): number[] => rig.viewer.layersShown;
const mean = (values: readonly number[]): number => values.reduce((sum, value) => sum + value, 0) / values.length;

async function play(seconds: number): Promise<void> {
  await Promise.all([rig.player.play(), pass(seconds)]);
}

describe("auto", () => {
  test("plays at best where the network gives twice the rate, without a stall", async () => {
    rig.begin(stream(30, FULL, 5), 2 * RATE);
    await play(32);
    expect(rig.viewer.frames).toEqual(frames(0, 750));
    expect(rig.player.stats).toMatchObject({ stalls: 0, skippedGroups: 0 });
    expect(mean(seen())).toBeGreaterThan(2.7);
    expect(rig.viewer.events).toContain("ended");
  });

  test("comes to the best on a link of 1 Mbit/s and 200 ms that is enough for it, ten times of ten", async () => {
    const [link, share] = [125_000, 0.85]; // bytes a second
    for (let seed = 1; seed <= 10; seed++) {
      let state = seed;
      const chain = [1, 2, 5][seed % 3];
      rig.begin(stream(36, FULL.map((rate) => (rate / RATE) * share * link), chain, 10 + 4 * seed), link);
      rig.source.latencyMs = 200;
      rig.source.delay = () => (state = (state * 48_271) % 0x7fff_ffff) / 0x7fff_ffff - 0.5;
      await play(37);
      expect([seed, seen().at(-1), rig.player.stats.stalls]).toEqual([seed, BEST, 0]);
      expect(mean(seen().slice(18 * 60)), `run ${seed}`).toBeGreaterThan(2.8);
      rig.viewer.stop();
      rig.player.dispose();
    }
  });

  test("drops layers where the network gives half the rate, and no frame", async () => {
    rig.begin(stream(30, FULL, 5), RATE / 2);
    await play(32);
    expect(rig.viewer.frames).toEqual(frames(0, 750));
    expect(rig.player.stats).toMatchObject({ stalls: 0, skippedGroups: 0 });
    expect(rig.viewer.events).toContain("ended");
    expect(mean(seen())).toBeGreaterThan(1.2); // the first three layers take less than half of the rate
    expect(seen().slice(0, 25 * 60)).not.toContain(BEST); // the last of all come in the idle time at the end
  });

  test("goes down when the network falls, and up again when it is back", async () => {
    rig.begin(stream(90, FULL, 5), 4 * RATE);
    await play(20);
    expect(seen().at(-1)).toBe(BEST);
    rig.source.bytesPerSecond = RATE / 3;
    await pass(30);
    expect(seen().at(-1)).toBeLessThan(BEST);
    expect(seen().at(-1)).toBeGreaterThan(0);
    rig.source.bytesPerSecond = 4 * RATE;
    await pass(30);
    expect(seen().at(-1)).toBe(BEST);
    await pass(15);
    expect(rig.viewer.frames).toEqual(frames(0, 2250));
    expect(rig.player.stats.stalls).toBe(0);
    expect(rig.viewer.count("layerschange")).toBeLessThan(12);
  });

  slowTest("settles where the network gives just what a level takes", async () => {
    for (const share of [0.3, 0.47, 0.6, 0.9, 1, 1.1]) {
      rig.begin(stream(60, FULL, 5), share * RATE);
      await play(62);
      expect(rig.viewer.frames).toHaveLength(1500);
      expect(rig.player.stats.stalls).toBe(0);
      expect(rig.viewer.count("layerschange")).toBeLessThan(16);
      rig.viewer.stop();
      rig.player.dispose();
    }
  });

  test("drops layers where workers are too slow for all of them", async () => {
    rig.workers.msOf = ({ ranges }) => [100, 200, 400, 900][ranges.length - 1]; // of groups of 400 ms
    rig.begin(stream(60, FULL, 5), 20 * RATE, { count: 1 });
    await play(70);
    expect(rig.viewer.frames).toEqual(frames(0, 1500));
    expect(rig.player.stats.stalls).toBeLessThanOrEqual(2); // the first is how it finds out
    const later = seen().slice(60 * 20);
    expect(mean(later)).toBeLessThan(2.2);
    expect(mean(later)).toBeGreaterThanOrEqual(1);
    expect(seen().slice(60)).not.toContain(0); // it is not thrown back by what began before
    expect(rig.player.stats.decodeLoad).toBeGreaterThan(0.2);
    expect(rig.player.stats.decodeLoad).toBeLessThan(1.1);
  });

  test("counts workers that can work beside each other", async () => {
    rig.workers.msOf = () => 600; // of groups of 400 ms, each alone
    rig.begin(stream(20, FULL), 20 * RATE, { count: 3 });
    await play(10);
    expect(rig.player.stats).toMatchObject({ stalls: 0, decodeLoad: expect.closeTo(0.5, 1) as number });
    await pass(14);
    expect(new Set(seen().slice(60))).toEqual(new Set([BEST])); // what came first was shown first
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("does not count on workers that have nothing to do: a chain is in one", async () => {
    rig.workers.msOf = ({ ranges }) => 200 * ranges.length;
    rig.begin(stream(20, FULL, 100), 20 * RATE, { count: 3 });
    await play(30);
    expect(seen().slice(600)).not.toContain(BEST);
    expect(rig.viewer.events).toContain("ended");
  });

  test("asks for no fewer layers of a server that sends everything anyhow", async () => {
    rig.begin(stream(20, FULL), RATE / 2);
    rig.source.isSelective = false;
    await play(60);
    expect(rig.viewer.count("layerschange")).toBe(1);
    expect(mean(seen())).toBeGreaterThan(2.5);
    expect(rig.viewer.frames).toEqual(frames(0, 500));
    expect(rig.player.stats.stalls).toBeGreaterThan(0);
  });

  test("rises in mid-chain where its bytes come in time, else at the next group that stands alone", async () => {
    rig.begin(stream(40, FULL, 20), RATE / 3);
    await play(1);
    rig.source.bytesPerSecond = 10 * RATE;
    await pass(40);
    expect(rig.viewer.frames).toEqual(frames(0, 1000));
    expect(seen()[60 * 3]).toBeLessThan(BEST);
    expect(new Set(seen().slice(60 * 9))).toEqual(new Set([BEST])); // from group 20 on
  });

  test("plays on at the lowest level, with stalls, where even that is too much", async () => {
    rig.begin(stream(10, FULL), 3000);
    await play(30);
    expect(new Set(seen().slice(120, 480))).toEqual(new Set([0])); // more of the first group came with the head, and of the last when all was there
    expect(rig.viewer.frames).toEqual(frames(0, 250));
    expect(rig.player.stats.stalls).toBeGreaterThan(0);
  });
});

describe("bytes at hand are shown, and idle time fetches more", () => {
  test.each([1, 5])("of a picture that stands, in chains of %i, layer by layer up to the last", async (chain) => {
    rig.begin(stream(2, FULL, chain), RATE / 6);
    void rig.player.load();
    await pass(15);
    expect(new Set(seen())).toEqual(new Set([0, 1, 2, 3].slice(Math.min(...seen().filter((layers) => layers >= 0)))));
    expect(seen().at(-1)).toBe(BEST);
    expect(rig.source.sentBytes).toBe(rig.source.size);
  });

  test("of a picture that stands in the middle of a chain of a long recording", async () => {
    rig.begin(stream(600, FULL, 10), RATE / 6);
    rig.player.currentTime = 3;
    void rig.player.load();
    await pass(60);
    expect(seen().at(-1)).toBe(BEST);
  });

  test("of a short loop, whatever the network gave before, without a stall", async () => {
    rig.begin(stream(2, FULL, 5), RATE / 6);
    rig.player.loop = true;
    await play(20);
    expect(new Set(seen().slice(-120))).toEqual(new Set([BEST]));
    expect(rig.player.stats.stalls).toBe(0);
    expect(rig.source.sentBytes).toBeLessThan(1.1 * rig.source.size!);
  });

  test("of a loop that is longer than what is decoded ahead", async () => {
    rig.begin(stream(8, FULL, 5), RATE / 3);
    rig.player.loop = true;
    await play(60);
    expect(new Set(seen().slice(-480))).toEqual(new Set([BEST]));
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("of a file of one group of three frames", async () => {
    rig.begin(makeReel([group(3, [4000, 8000, 16_000])], { frameRate: 25 }), 2000);
    void rig.player.load();
    await pass(20);
    expect(rig.viewer.shown?.groups[0]?.layers).toBe(2);
  });

  test("of a loop that workers are too slow for while it comes: once all is decoded, it is refined", async () => {
    rig.workers.msOf = ({ ranges }) => [100, 200, 400, 900][ranges.length - 1];
    rig.begin(stream(2, FULL, 5), 20 * RATE, { count: 1 });
    rig.player.loop = true;
    await play(30);
    expect(new Set(seen().slice(-240))).toEqual(new Set([BEST]));
  });

  test("of a pause while workers are too slow to play with all layers", async () => {
    rig.workers.msOf = ({ ranges }) => [100, 200, 400, 900][ranges.length - 1];
    rig.begin(stream(60, FULL, 5), 20 * RATE, { count: 1 });
    await play(20);
    expect(seen().at(-1)).toBeLessThan(BEST);
    rig.player.pause();
    await pass(10);
    expect(seen().at(-1)).toBe(BEST);
  });
});

describe("layers chosen by hand", () => {
  test("is what is fetched and shown, and no more", async () => {
    rig.begin(stream(20, FULL, 5), 10 * RATE);
    rig.player.layers = 1;
    await play(22);
    expect(new Set(seen())).toEqual(new Set([1]));
    expect(rig.source.sentBytes).toBeLessThan(20 * 13_000 + 16_384);
    expect(rig.player.stats).toMatchObject({ layers: 1, mbps: expect.closeTo((12_000 * 8) / 1e6, 2) as number });
  });

  test("that is finer is shown at once, its chain decoded again in the same worker; old groups stay until then", async () => {
    rig.begin(stream(20, FULL, 10), 10 * RATE);
    rig.player.layers = 1;
    void rig.player.load();
    await pass(2);
    rig.player.currentTime = 2.5; // group 6
    await pass(2);
    const begun = rig.workers.begun.length;
    rig.player.layers = 3;
    await pass(0.02);
    expect(rig.viewer.shown?.groups[0]?.layers).toBe(1);
    await pass(1);
    expect(rig.viewer.shown?.groups[0]).toMatchObject({ layers: 3, chunk: 6 });
    const again = rig.workers.begun.slice(begun);
    expect(again.slice(0, 7).map(({ job }) => [job.chunk, job.stateOnly])).toEqual(
      [[0, true], [1, true], [2, true], [3, true], [4, true], [5, true], [6, false]],
    );
    expect(again.every(({ job }) => job.layers === null)).toBe(true);
    expect(rig.source.sentBytes).toBeLessThanOrEqual(rig.source.size!);
    expect(rig.viewer.count("layerschange")).toBe(2);
  });

  test("that is coarser is shown at once and needs no chain", async () => {
    rig.begin(stream(20, FULL, 10), 10 * RATE);
    rig.player.layers = 3;
    void rig.player.load();
    await pass(2);
    rig.player.currentTime = 2.5;
    await pass(2);
    const begun = rig.workers.begun.length;
    rig.player.layers = 0;
    await pass(1);
    expect(rig.viewer.shown?.groups[0]?.layers).toBe(0);
    expect(rig.workers.begun[begun].job).toMatchObject({ chunk: 6, layers: 0, stateOnly: false });
  });

  test("beyond what there is means all of it, and chunks of fewer layers are whole", async () => {
    const chunks = [group(10, [500, 500]), group(10, [300]), group(10, [500, 500, 500], { dependsOn: [1] })];
    rig.begin(makeReel(chunks, { frameRate: 25 }), 10 * RATE);
    rig.player.layers = 7;
    await play(2);
    expect(rig.workers.begun.map(({ job }) => [job.ranges.length, job.layers])).toEqual([[2, null], [1, null], [3, null]]);
  });

  test("that comes while a seek is under way is shown in the place of what it replaces", async () => {
    rig.begin(stream(60, FULL), 10 * RATE);
    rig.player.layers = 0;
    void rig.player.load();
    await pass(1);
    rig.workers.msOf = () => 100;
    rig.source.latencyMs = 500;
    rig.player.layers = 3;
    await pass(0.6); // the fine layers are there, and are being decoded
    const before = rig.viewer.shown;
    expect(before).toMatchObject({ frame: 0, groups: [{ layers: 0 }] });
    rig.player.currentTime = 50;
    await pass(0.3);
    expect(rig.viewer.shown).toMatchObject({ frame: 0, groups: [{ chunk: 0, layers: 3 }] });
    await pass(2);
    expect(rig.viewer.shown).toMatchObject({ frame: 1250, groups: [{ layers: 3 }] });
  });

  test("changed in mid-play many times never breaks a chain", async () => {
    rig.begin(stream(30, FULL, 10), 5 * RATE);
    await play(1);
    for (let k = 0; k < 40; k++) {
      rig.player.layers = ([3, 0, 2, "auto", 1] as const)[k % 5];
      await pass(0.1 + (k % 7) / 5);
    }
    expect(rig.viewer.warnings).toEqual([]);
    expect(rig.player.stats.skippedGroups).toBe(0);
    expect(rig.viewer.frames.length).toBeGreaterThan(400);
  });
});

test("how many layers the group shown has is told, as it may have fewer than the file's richest", async () => {
  rig.begin(makeReel([group(25, [100]), group(25, [100, 100, 100, 100]), group(25, [100, 100])], { frameRate: 25 }), 1e6);
  void rig.player.load();
  const told: number[][] = [];
  for (const layers of [3, 1] as const) {
    rig.player.layers = layers;
    for (const time of [0.5, 1.5, 2.5]) {
      rig.player.currentTime = time;
      await pass(1);
      told.push([rig.player.stats.layers, rig.player.stats.wholeLayers]);
    }
  }
  expect(rig.player.info?.mostLayers).toBe(3);
  expect(told).toEqual([[0, 0], [3, 3], [1, 1], [0, 0], [1, 3], [1, 1]]);
});
