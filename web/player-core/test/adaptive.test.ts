import { describe, expect, test } from "vitest";

import { Adaptive } from "../src/time/adaptive.ts";
import type { Conditions } from "../src/time/adaptive.ts";
import { Timeline } from "../src/time/clock.ts";
import { Head } from "../src/format/reader.ts";
import { stream } from "./reel.ts";

const LAYERS = [10_000, 20_000, 40_000, 80_000]; // bytes a second
const HEAD = Head.parse(stream(60, LAYERS));
const TIMELINE = new Timeline(1500, (frame) => frame / 25);
const GOOD: Conditions = { now: 0, time: 0, speed: 1, bandwidth: 1e9, fetched: 10, decoded: 3, load: 0.1, isWaiting: false };
const bits = (bytes: number): number => 8 * bytes;

function make(bandwidth: number): Adaptive {
  return new Adaptive(HEAD, TIMELINE, bandwidth, { textures: null, splats: false });
}

test("rates are those of the file's own bytes", () => {
  make(0).rates(30).forEach((rate, level) => expect(rate).toBeCloseTo(bits([10_000, 30_000, 70_000, 150_000][level]), 0));
});

describe("the start", () => {
  test("is at best without a network, and within what was measured with one", () => {
    const levels = [0, 1, 12_000, 51_000, 120_000, 251_000].map((bytes) => make(bits(bytes)).level);
    expect(levels).toEqual([3, 0, 0, 1, 2, 3]);
  });
});

describe("the network", () => {
  test("too slow is followed at once when little is left, not while much is", () => {
    const adaptive = make(0);
    expect(adaptive.decide({ ...GOOD, now: 0, bandwidth: bits(50_000), fetched: 8 })).toBe(3);
    expect(adaptive.decide({ ...GOOD, now: 1, bandwidth: bits(50_000), fetched: 2 })).toBe(1);
  });

  test("is used with more care the less is left", () => {
    const level = (fetched: number, isWaiting = false): number => make(0).decide({ ...GOOD, bandwidth: bits(83_000), fetched, isWaiting });
    expect([level(2.5), level(0.5), level(0, true)]).toEqual([2, 1, 1]);
    expect(make(0).decide({ ...GOOD, bandwidth: bits(59_000), fetched: 0, isWaiting: true })).toBe(0);
  });

  test("better again is used after a while, and only where it leaves room", () => {
    const adaptive = make(0);
    adaptive.decide({ ...GOOD, now: 0, bandwidth: bits(50_000), fetched: 1 });
    expect(adaptive.level).toBe(1);
    const later = { ...GOOD, fetched: 4, bandwidth: bits(101_000) };
    expect(adaptive.decide({ ...later, now: 1000 })).toBe(1);
    expect(adaptive.decide({ ...later, now: 2500, decoded: 1 })).toBe(1);
    expect(adaptive.decide({ ...later, now: 2500, bandwidth: bits(90_000) })).toBe(1);
    expect(adaptive.decide({ ...later, now: 2500 })).toBe(2);
    expect(adaptive.decide({ ...later, now: 5000, bandwidth: bits(170_000) })).toBe(2);
    expect(adaptive.decide({ ...later, now: 5000, bandwidth: bits(170_000), fetched: 9 })).toBe(3);
  });

  test("at twice the speed must give twice as much", () => {
    expect(make(0).decide({ ...GOOD, bandwidth: bits(200_000), fetched: 2 })).toBe(3);
    expect(make(0).decide({ ...GOOD, bandwidth: bits(200_000), fetched: 2, speed: 2 })).toBe(2);
  });
});

describe("decoding", () => {
  const LATE: Conditions = { ...GOOD, bandwidth: 0, decoded: 0.5 };

  test("that falls behind drops as many layers as its bytes make likely", () => {
    expect(make(0).decide({ ...LATE, load: 1.1 })).toBe(2);
    expect(make(0).decide({ ...LATE, load: 3 })).toBe(1);
    expect(make(0).decide({ ...LATE, load: 50 })).toBe(0);
  });

  test("drops nothing while enough is decoded, or while it is bytes that are missing", () => {
    expect(make(0).decide({ ...LATE, load: 3, decoded: 3 })).toBe(3);
    expect(make(0).decide({ ...LATE, load: 3, fetched: 0.5 })).toBe(3);
    expect(make(0).decide({ ...LATE, load: 0.8 })).toBe(3);
  });

  test("with time to spare tries one level more, and knows those that it has tried", () => {
    const adaptive = make(bits(60_000));
    expect(adaptive.level).toBe(1);
    const fine = { ...GOOD, decoded: 3 };
    expect(adaptive.decide({ ...fine, now: 3000, load: 0 })).toBe(1);
    expect(adaptive.decide({ ...fine, now: 3000, load: 0.6 })).toBe(1);
    expect(adaptive.decide({ ...fine, now: 3000, load: 0.3 })).toBe(2);
    expect(adaptive.decide({ ...fine, now: 6000, load: 0.39 })).toBe(3);
    adaptive.decide({ ...fine, now: 7000, load: 0.7 });
    adaptive.decide({ ...fine, now: 8000, load: 0.7, bandwidth: bits(20_000), fetched: 0.1 });
    expect(adaptive.level).toBe(0);
    expect(adaptive.decide({ ...fine, now: 11_000, load: 0.5 })).toBe(3);
  });

  test("that fell behind at a level is not tried there again for a while, the longer the more often it did", () => {
    const adaptive = make(0);
    let now = 0;
    const waits: number[] = [];
    for (let round = 0; round < 6; round++) {
      expect(adaptive.decide({ ...LATE, now, load: 1.1 })).toBe(2);
      const fell = now;
      while (adaptive.decide({ ...GOOD, now, load: 0.3, bandwidth: 0 }) < 3) now += 500;
      waits.push((now - fell) / 1000);
    }
    expect(waits).toEqual([15, 30, 60, 120, 120, 120]);
  });

  test("at another speed is another load", () => {
    const adaptive = make(0);
    adaptive.decide({ ...GOOD, now: 0, load: 0.6 });
    adaptive.decide({ ...GOOD, now: 100, bandwidth: bits(50_000), fetched: 1, load: 0.6 });
    expect(adaptive.level).toBe(1);
    expect(adaptive.decide({ ...GOOD, now: 5000, speed: 2, load: 0.7 })).toBe(1);
    expect(adaptive.decide({ ...GOOD, now: 5000, speed: 1, load: 0.5 })).toBe(3);
  });
});
