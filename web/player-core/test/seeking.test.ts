// Seeking, on a clock that the tests turn.

import { describe, expect, test } from "vitest";

import { stream } from "./reel.ts";
import { pass, useRig } from "./rig.ts";

const FULL = [4000, 8000, 16000, 32000]; // bytes a second of each layer: 60 000 in all
const RATE = 60_000;

const rig = useRig();

describe("seeking", () => {
  test("shows the frame after its group's bytes and decoding, and keeps what was shown until then", async () => {
    rig.begin(stream(60, FULL), 2 * RATE, { bufferSeconds: 4 });
    rig.player.layers = 3;
    void rig.player.load();
    await pass(8);
    rig.player.currentTime = 30;
    expect(rig.player).toMatchObject({ seeking: true, currentFrame: 750 });
    const reads = rig.source.reads.length;
    await pass(0.1);
    expect(rig.viewer.shown?.frame).toBe(0);
    await pass(0.2);
    expect(rig.viewer.shown?.frame).toBe(750);
    expect(rig.source.reads[reads].sent).toBeLessThanOrEqual(0.3 * 2 * RATE);
    expect(rig.viewer.events.slice(-2)).toEqual(["seeking", "seeked"]);
    expect(rig.player.seeking).toBe(false);
  });

  test("cancels what was on its way and decodes nothing of it", async () => {
    rig.begin(stream(60, FULL), RATE);
    rig.workers.msOf = () => 900;
    void rig.player.load();
    await pass(2);
    const open = rig.source.reads.filter(({ state }) => state === "open");
    expect(open.length).toBeGreaterThan(0);
    const begun = rig.workers.begun.length;
    const readied = rig.viewer.readied.length;
    expect(begun).toBeGreaterThan(readied); // one is being decoded
    rig.player.currentTime = 40;
    await pass(10);
    expect(rig.viewer.readied.slice(readied).filter((chunk) => chunk < 100)).toEqual([]);
    expect(open.every(({ state }) => state === "cancelled")).toBe(true);
    const late = rig.workers.chunks.slice(begun);
    expect(late.filter((chunk) => chunk < 100)).toEqual([]);
    expect(late[0]).toBe(100);
  });

  test("decodes the chain that a group is predicted from, and shows none of it", async () => {
    rig.begin(stream(60, FULL, 10), 20 * RATE, { bufferSeconds: 1, decodedSeconds: 1 });
    void rig.player.load();
    await pass(1);
    const begun = rig.workers.begun.length;
    rig.player.currentTime = 21; // frame 525, group 52, of the chain that begins with group 50
    await pass(1);
    expect(rig.workers.begun.slice(begun).map(({ job }) => [job.chunk, job.stateOnly]).slice(0, 3)).toEqual([[50, true], [51, true], [52, false]]);
    expect(new Set(rig.workers.begun.slice(begun, begun + 4).map(({ worker }) => worker)).size).toBe(1);
    expect([...rig.viewer.alive].every(({ chunk }) => chunk >= 52)).toBe(true);
  });

  test("back within a chain uses the states that workers kept", async () => {
    rig.begin(stream(20, FULL, 10), 100 * RATE, { decodedSeconds: 2 });
    await Promise.all([rig.player.play(), pass(3.2)]);
    const begun = rig.workers.begun.length;
    rig.player.pause();
    rig.player.currentTime = 1;
    await pass(1);
    expect(rig.workers.begun.slice(begun)[0].job).toMatchObject({ chunk: 2, stateOnly: false, previous: 1 });
    expect(rig.source.sentBytes).toBeLessThanOrEqual(rig.source.size!);
  });

  test("many times a second ends at the last place, and tells it once", async () => {
    rig.begin(stream(60, FULL), 5 * RATE);
    void rig.player.load();
    await pass(1);
    for (let k = 0; k < 100; k++) {
      rig.player.currentTime = (k * 37) % 60;
      await pass(0.02);
    }
    rig.player.currentTime = 33.4;
    await pass(2);
    expect(rig.viewer.shown?.frame).toBe(835);
    expect(rig.viewer.count("seeking")).toBe(101);
    expect(rig.viewer.events.at(-1)).toBe("seeked");
    expect(rig.source.reads.filter(({ state }) => state === "open").length).toBeLessThanOrEqual(4);
  });

  test("before the head is there begins there", async () => {
    rig.begin(stream(60, FULL), 5 * RATE);
    rig.player.currentTime = 50;
    await Promise.all([rig.player.play(), pass(2)]);
    expect(rig.viewer.frames[0]).toBe(1250);
    expect(rig.workers.chunks.filter((chunk) => chunk < 125)).toEqual([]);
  });

  test("goes on playing where it played", async () => {
    rig.begin(stream(60, FULL), 20 * RATE);
    await Promise.all([rig.player.play(), pass(1)]);
    rig.player.currentTime = 30;
    await pass(2);
    expect(rig.player.currentTime).toBeGreaterThan(31.5);
    expect(rig.viewer.events.slice(-3)).toEqual(["seeking", "seeked", "playing"]);
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("beyond the ends is at the ends; to no number is refused", async () => {
    rig.begin(stream(4, FULL), 20 * RATE);
    void rig.player.load();
    await pass(1);
    rig.player.currentTime = 99;
    expect([rig.player.currentTime, rig.player.currentFrame]).toEqual([4, 99]);
    rig.player.currentTime = -5;
    expect(rig.player.currentTime).toBe(0);
    expect(() => (rig.player.currentTime = NaN)).toThrow(TypeError);
    expect(() => (rig.player.playbackRate = NaN)).toThrow(TypeError);
    expect(() => (rig.player.layers = -1)).toThrow(TypeError);
  });

  test("by steps goes from frame to frame, and stops at the ends", async () => {
    rig.begin(stream(4, FULL), 20 * RATE);
    await Promise.all([rig.player.play(), pass(1)]);
    rig.player.step(1);
    const frame = rig.player.currentFrame;
    expect(rig.player.paused).toBe(true);
    for (const [steps, wanted] of [[1, frame + 1], [-2, frame - 1], [1000, 99], [-1000, 0], [-1, 0]]) {
      rig.player.step(steps);
      await pass(0.2);
      expect(rig.viewer.shown).toMatchObject({ frame: wanted, blend: 0 });
    }
  });
});
