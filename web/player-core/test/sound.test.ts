// Sound and the clock that it leads, with a stand-in for the audio element.

import { describe, expect, test, vi } from "vitest";

import { Head } from "../src/format/reader.ts";
import { audio, group, makeReel } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";
import type { PlayerOptions } from "../src/player.ts";
import { pass, useRig } from "./rig.ts";

const RATE = 1e6; // bytes a second
const SECONDS = 10;

/** Keeps the time of the tests; begins late, and runs at another speed than it should. */
class FakeVoice extends EventTarget {
  error: { message: string } | null = null;
  paused = true;
  playbackRate = 1;
  volume = 1;
  speed = 1;
  plays = 0;
  refuses = false;
  bad = false;
  #at = 0;
  #since = 0;
  readonly duration: number;
  readonly lateMs: number;

  constructor(duration = SECONDS, lateMs = 80) {
    super();
    this.duration = duration;
    this.lateMs = lateMs;
  }

  set src(_: string) {
    if (this.bad) this.error = { message: "no decoder" };
    setTimeout(() => this.dispatchEvent(new Event(this.bad ? "error" : "loadedmetadata")));
  }
  removeAttribute(): void {}
  get currentTime(): number {
    if (!this.paused) this.#go();
    return this.#at;
  }
  set currentTime(time: number) {
    [this.#at, this.#since] = [time, performance.now()];
  }
  async play(): Promise<void> {
    this.plays++;
    if (this.refuses) throw new DOMException("not yet", "NotAllowedError");
    [this.paused, this.#since] = [false, performance.now() + this.lateMs];
  }
  pause(): void {
    this.#go();
    this.paused = true;
  }
  #go(): void {
    const passed = performance.now() - this.#since;
    if (passed <= 0) return;
    this.#at += (passed / 1000) * this.playbackRate * this.speed;
    this.#since = performance.now();
    if (this.#at < this.duration || this.paused) return;
    [this.#at, this.paused] = [this.duration, true];
    this.dispatchEvent(new Event("ended"));
  }
}

const rig = useRig();
const groups = (count = 25): FakeChunk[] => Array.from({ length: count }, () => group(10, [2000]));
let voice: FakeVoice;

function begin(chunk: FakeChunk, made = new FakeVoice(), more: Partial<PlayerOptions> = {}): void {
  voice = made;
  rig.begin(makeReel([...groups(1), chunk, ...groups(24)], { frameRate: 25 }), RATE, { voice: () => voice as unknown as HTMLAudioElement, ...more });
}
const drift = (start = 0): number => voice.currentTime + start - rig.player.currentTime;

describe("sound", () => {
  test.each([0.97, 1.03])("leads the clock, though it runs at %f of the speed that the display has", async (speed) => {
    begin(audio(5000));
    voice.speed = speed;
    await Promise.all([rig.player.play(), pass(1)]);
    for (let k = 0; k < 40; k++) {
      await pass(0.1);
      expect(Math.abs(drift())).toBeLessThan(0.035); // and what is between two pictures
    }
    expect(rig.player.currentTime).toBeGreaterThan(4 * speed);
    expect(voice.plays).toBe(1);
  });

  test("is heard from its start on, and stands with the picture", async () => {
    begin(audio(5000, 1), new FakeVoice(2));
    await Promise.all([rig.player.play(), pass(0.9)]);
    expect([voice.plays, voice.paused]).toEqual([0, true]);
    await pass(1);
    expect(Math.abs(drift(1))).toBeLessThan(0.035);
    rig.player.pause();
    expect(voice.paused).toBe(true);
    const { currentTime } = voice;
    await pass(5);
    expect(voice.currentTime).toBe(currentTime);
    await Promise.all([rig.player.play(), pass(0.5)]);
    expect(Math.abs(drift(1))).toBeLessThan(0.035);
    await pass(3); // its end, and on
    expect([voice.paused, voice.plays, rig.player.paused]).toEqual([true, 2, false]);
    expect(rig.player.currentTime).toBeGreaterThan(4.5);
  });

  test("is silent while the picture stalls, and in step behind that", async () => {
    begin(audio(5000), new FakeVoice(), { bufferSeconds: 2, decodedSeconds: 1 });
    await Promise.all([rig.player.play(), pass(1)]);
    rig.source.bytesPerSecond = 1;
    await pass(5);
    expect([rig.player.stats.stalls, voice.paused]).toEqual([1, true]);
    expect(Math.abs(drift())).toBeLessThan(0.1); // it stands where it was; play begins at the picture's place
    rig.source.bytesPerSecond = RATE;
    await pass(2);
    expect([voice.paused, voice.plays]).toEqual([false, 2]);
    expect(Math.abs(drift())).toBeLessThan(0.035);
  });

  test("is silent while nothing is displayed", async () => {
    begin(audio(5000));
    await Promise.all([rig.player.play(), pass(1)]);
    rig.viewer.stop();
    await pass(3);
    expect(voice.paused).toBe(true);
    expect(rig.player.currentTime).toBeLessThan(1.2);
  });

  test("is fetched when it is unmuted, and volume and muting are told", async () => {
    begin(audio(50_000));
    rig.player.sound.muted = true;
    const told = vi.fn();
    rig.player.addEventListener("volumechange", told);
    await Promise.all([rig.player.play(), pass(1)]);
    expect([rig.player.sound.voice, voice.plays, rig.player.info?.hasAudio]).toEqual([null, 0, true]);
    rig.player.sound.volume = 0.5;
    rig.player.sound.muted = false;
    rig.player.sound.muted = false;
    await pass(1);
    expect([voice.volume, voice.plays, told.mock.calls.length]).toEqual([0.5, 1, 2]);
    expect(Math.abs(drift())).toBeLessThan(0.035);
    expect(() => void (rig.player.sound.volume = 2)).toThrow("give a number from 0 to 1");
  });

  test("is muted where the browser refuses it, and the picture goes on", async () => {
    begin(audio(5000));
    voice.refuses = true;
    await Promise.all([rig.player.play(), pass(2)]);
    expect([rig.player.sound.muted, voice.plays, rig.player.stats.stalls]).toEqual([true, 1, 0]);
    expect(rig.player.currentTime).toBeGreaterThan(1.7);
  });

  test("is not waited for longer than some seconds", async () => {
    begin(audio(6 * RATE));
    const play = rig.player.play();
    await pass(2);
    expect(rig.player.currentTime).toBe(0);
    await Promise.all([play, pass(2)]);
    expect(rig.player.currentTime).toBeGreaterThan(0.5);
    await pass(4);
    expect(Math.abs(drift())).toBeLessThan(0.035);
  });

  test.each([
    ["of an unknown type", { body: Uint8Array.of(10, 77, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2), layers: [12] }, "77 is none of the known values"],
    ["without bytes", { body: Uint8Array.of(10, 1, 0, 0, 0, 0, 0, 0, 0, 0), layers: [10] }, "no bytes of audio"],
    ["that is cut off", { body: Uint8Array.of(10, 1, 0, 0), layers: [4] }, "8 bytes needed"],
    ["that begins after the end of time", { body: Uint8Array.of(10, 1, 0, 0, 0, 0, 0, 0, 0, 0x7f, 9), layers: [11] }, "beyond 53 bits"],
  ])("%s is left out with a warning", async (_, more, message) => {
    begin(audio(0, 0, more));
    await Promise.all([rig.player.play(), pass(2)]);
    expect(rig.viewer.warnings).toEqual([expect.stringContaining(message)]);
    expect([voice.plays, rig.player.currentTime > 1.5]).toEqual([0, true]);
  });

  test("that the browser cannot play is left out with a warning", async () => {
    begin(audio(5000));
    voice.bad = true;
    await Promise.all([rig.player.play(), pass(2)]);
    expect(rig.viewer.warnings).toEqual(["no sound: audio/ogg cannot be played here: no decoder"]);
    expect(rig.player.currentTime).toBeGreaterThan(1.5);
  });

  test.each([
    [[audio(5), audio(5)], "audio besides other audio"],
    [[audio(5, 0, { track: 1 })], "not on its own"],
    [[audio(5, 0, { form: 3 })], "not on its own"],
    [[audio(5, 0, { dependsOn: [0] })], "not on its own"],
    [[audio(5, 0, { layers: [1e9] })], "1000000000 bytes of audio, over 268435456"],
  ])("is one, for all frames", (chunks, message) => {
    expect(() => Head.parse(makeReel([...groups(1), ...chunks], { frameRate: 25 }))).toThrow(message);
  });
});
