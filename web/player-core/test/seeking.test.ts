// Seeking, on a clock that the tests turn.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import type { Player } from "../src/player.ts";
import type { FakeWorkers } from "./fake_workers.ts";
import { stream } from "./reel.ts";
import { Rig, pass } from "./rig.ts";
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

describe("seeking", () => {
  test("shows the frame after its group's bytes and decoding, and keeps what was shown until then", async () => {
    begin(stream(60, FULL), 2 * RATE, { bufferSeconds: 4 });
    player.quality = 3;
    void player.load();
    await pass(8);
    player.currentTime = 30;
    expect(player).toMatchObject({ seeking: true, currentFrame: 750 });
    const reads = source.reads.length;
    await pass(0.1);
    expect(viewer.shown?.frame).toBe(0);
    await pass(0.2);
    expect(viewer.shown?.frame).toBe(750);
    expect(source.reads[reads].sent).toBeLessThanOrEqual(0.3 * 2 * RATE);
    expect(viewer.events.slice(-2)).toEqual(["seeking", "seeked"]);
    expect(player.seeking).toBe(false);
  });

  test("cancels what was on its way and decodes nothing of it", async () => {
    begin(stream(60, FULL), RATE);
    workers.msOf = () => 900;
    void player.load();
    await pass(2);
    const open = source.reads.filter(({ state }) => state === "open");
    expect(open.length).toBeGreaterThan(0);
    const begun = workers.begun.length;
    const readied = viewer.readied.length;
    expect(begun).toBeGreaterThan(readied); // one is being decoded
    player.currentTime = 40;
    await pass(10);
    expect(viewer.readied.slice(readied).filter((chunk) => chunk < 100)).toEqual([]);
    expect(open.every(({ state }) => state === "cancelled")).toBe(true);
    const late = workers.chunks.slice(begun);
    expect(late.filter((chunk) => chunk < 100)).toEqual([]);
    expect(late[0]).toBe(100);
  });

  test("decodes the chain that a group is predicted from, and shows none of it", async () => {
    begin(stream(60, FULL, 10), 20 * RATE, { bufferSeconds: 1, decodedSeconds: 1 });
    void player.load();
    await pass(1);
    const begun = workers.begun.length;
    player.currentTime = 21; // frame 525, group 52, of the chain that begins with group 50
    await pass(1);
    expect(workers.begun.slice(begun).map(({ job }) => [job.chunk, job.stateOnly]).slice(0, 4)).toEqual(
      [[50, true], [51, true], [52, false], [53, false]],
    );
    expect(new Set(workers.begun.slice(begun, begun + 4).map(({ worker }) => worker)).size).toBe(1);
    expect([...viewer.alive].every(({ chunk }) => chunk >= 52)).toBe(true);
  });

  test("back within a chain uses the states that workers kept", async () => {
    begin(stream(20, FULL, 10), 100 * RATE, { decodedSeconds: 2 });
    await Promise.all([player.play(), pass(3.2)]);
    const begun = workers.begun.length;
    player.pause();
    player.currentTime = 1;
    await pass(1);
    expect(workers.begun.slice(begun)[0].job).toMatchObject({ chunk: 2, stateOnly: false, previous: 1 });
    expect(source.sentBytes).toBeLessThanOrEqual(source.size!);
  });

  test("many times a second ends at the last place, and tells it once", async () => {
    begin(stream(60, FULL), 5 * RATE);
    void player.load();
    await pass(1);
    for (let k = 0; k < 100; k++) {
      player.currentTime = (k * 37) % 60;
      await pass(0.02);
    }
    player.currentTime = 33.4;
    await pass(2);
    expect(viewer.shown?.frame).toBe(835);
    expect(viewer.count("seeking")).toBe(101);
    expect(viewer.events.at(-1)).toBe("seeked");
    expect(source.reads.filter(({ state }) => state === "open").length).toBeLessThanOrEqual(4);
  });

  test("before the head is there begins there", async () => {
    begin(stream(60, FULL), 5 * RATE);
    player.currentTime = 50;
    await Promise.all([player.play(), pass(2)]);
    expect(viewer.frames[0]).toBe(1250);
    expect(workers.chunks.filter((chunk) => chunk < 125)).toEqual([]);
  });

  test("goes on playing where it played", async () => {
    begin(stream(60, FULL), 20 * RATE);
    await Promise.all([player.play(), pass(1)]);
    player.currentTime = 30;
    await pass(2);
    expect(player.currentTime).toBeGreaterThan(31.5);
    expect(viewer.events.slice(-3)).toEqual(["seeking", "seeked", "playing"]);
    expect(player.stats.stalls).toBe(0);
  });

  test("beyond the ends is at the ends; to no number is refused", async () => {
    begin(stream(4, FULL), 20 * RATE);
    void player.load();
    await pass(1);
    player.currentTime = 99;
    expect([player.currentTime, player.currentFrame]).toEqual([4, 99]);
    player.currentTime = -5;
    expect(player.currentTime).toBe(0);
    expect(() => (player.currentTime = NaN)).toThrow(TypeError);
    expect(() => (player.playbackRate = NaN)).toThrow(TypeError);
    expect(() => (player.quality = -1)).toThrow(TypeError);
  });

  test("by steps goes from frame to frame, and stops at the ends", async () => {
    begin(stream(4, FULL), 20 * RATE);
    await Promise.all([player.play(), pass(1)]);
    player.step(1);
    const frame = player.currentFrame;
    expect(player.paused).toBe(true);
    for (const [steps, wanted] of [[1, frame + 1], [-2, frame - 1], [1000, 99], [-1000, 0], [-1, 0]]) {
      player.step(steps);
      await pass(0.2);
      expect(viewer.shown).toMatchObject({ frame: wanted, blend: 0 });
    }
  });
});
