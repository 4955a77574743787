import { describe, expect, test } from "vitest";

import { Adaptive } from "../src/time/adaptive.ts";
import type { Conditions } from "../src/time/adaptive.ts";
import { Timeline } from "../src/time/clock.ts";
import { Head } from "../src/format/reader.ts";
import { stream } from "./reel.ts";

const LAYERS = [10_000, 20_000, 40_000, 80_000]; // bytes a second
const HEAD = Head.parse(stream(60, LAYERS));
const TIMELINE = new Timeline(1500, (frame) => frame / 25);
/** What decoding takes of the time, by layers beyond the first, with the last that groups were decoded with. */
const loads = (layers: number, ...known: number[]): Pick<Conditions, "layers" | "loadAt"> => ({ layers, loadAt: (other) => known[other] ?? 0 });
const GOOD: Conditions = { now: 0, time: 0, speed: 1, bandwidth: 1e9, fetched: 10, decoded: 3, ...loads(3), isWaiting: false, isResting: false };
const bits = (bytes: number): number => 8 * bytes;

function make(): Adaptive {
  return new Adaptive(HEAD, TIMELINE, { textures: null, splats: false });
}

test("rates are those of the file's own bytes", () => {
  make().rates(30).forEach((rate, level) => expect(rate).toBeCloseTo(bits([10_000, 30_000, 70_000, 150_000][level]), 0));
});

test("the start is at best, until bandwidth is measured and little is at hand", () => {
  expect(make().level).toBe(3);
  const levels = [0, 1, 12_000, 51_000, 120_000, 251_000].map((bytes) => make().decide({ ...GOOD, fetched: 0, decoded: 0, bandwidth: bits(bytes) }));
  expect(levels).toEqual([3, 0, 0, 1, 2, 3]);
});

describe("the network", () => {
  test("too slow is followed at once when little is left, not while much is", () => {
    const adaptive = make();
    expect(adaptive.decide({ ...GOOD, now: 0, bandwidth: bits(50_000), fetched: 8 })).toBe(3);
    expect(adaptive.decide({ ...GOOD, now: 1, bandwidth: bits(50_000), fetched: 2 })).toBe(1);
  });

  test("is used with more care the less is left", () => {
    const level = (fetched: number, isWaiting = false): number => make().decide({ ...GOOD, bandwidth: bits(83_000), fetched, isWaiting });
    expect([level(2.5), level(0.5), level(0, true)]).toEqual([2, 1, 1]);
    expect(make().decide({ ...GOOD, bandwidth: bits(59_000), fetched: 0, isWaiting: true })).toBe(0);
  });

  test("better again is used after a while, and only where it leaves room", () => {
    const adaptive = make();
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
    expect(make().decide({ ...GOOD, bandwidth: bits(200_000), fetched: 2 })).toBe(3);
    expect(make().decide({ ...GOOD, bandwidth: bits(200_000), fetched: 2, speed: 2 })).toBe(2);
  });
});

describe("decoding", () => {
  const LATE: Conditions = { ...GOOD, bandwidth: 0, decoded: 0.5 };

  test("that falls behind drops as many layers as its bytes make likely", () => {
    const bearable = (load: number): number => {
      const adaptive = make();
      expect(adaptive.decide({ ...LATE, ...loads(3, 0, 0, 0, load) })).toBe(adaptive.bearable);
      return adaptive.bearable;
    };
    expect([bearable(1.1), bearable(3), bearable(50)]).toEqual([2, 1, 0]);
  });

  test("drops nothing while enough is decoded, while it is bytes that are missing, or while it has time to rest", () => {
    const layers = (conditions: Partial<Conditions>): number => make().decide({ ...LATE, ...loads(3, 0, 0, 0, 3), ...conditions });
    expect([layers({}), layers({ decoded: 3 }), layers({ fetched: 0.5 }), layers({ isResting: true }), layers(loads(3, 0, 0, 0, 0.8))]).toEqual([1, 3, 3, 3, 3]);
  });

  test("that was begun with more layers than are borne does not count", () => {
    const adaptive = make();
    adaptive.decide({ ...LATE, ...loads(3, 0, 0, 0, 1.1) });
    adaptive.decide({ ...LATE, ...loads(3, 0, 0, 0, 1.1), now: 100 });
    expect(adaptive.bearable).toBe(2);
    adaptive.decide({ ...LATE, ...loads(2, 0, 0, 1.1, 1.1), now: 200 });
    expect(adaptive.bearable).toBe(1);
  });

  test("with time to spare tries one layer more, and knows those that it has tried", () => {
    const adaptive = make();
    adaptive.decide({ ...LATE, ...loads(3, 0, 0, 0, 50) });
    expect(adaptive.bearable).toBe(0);
    const borne = (now: number, layers: number, ...known: number[]): number => {
      adaptive.decide({ ...GOOD, now, ...loads(layers, ...known) });
      return adaptive.bearable;
    };
    expect(borne(1000, 0, 0.1)).toBe(0); // too soon
    expect(borne(3000, 0, 0.5)).toBe(0); // the next may take twice as much
    expect(borne(3000, 0, 0.3)).toBe(1);
    expect(borne(6000, 1, 0.3, 0.6, 0.7)).toBe(2);
    expect(borne(20_000, 2, 0.3, 0.6, 0.7, 0.75)).toBe(Infinity);
  });

  test("that fell behind at a level is not tried there again for a while, the longer the more often it did", () => {
    const adaptive = make();
    let now = 0;
    const waits: number[] = [];
    for (let round = 0; round < 6; round++) {
      expect(adaptive.decide({ ...LATE, now, ...loads(3, 0, 0, 0, 1.1) })).toBe(2);
      const fell = now;
      while (adaptive.decide({ ...GOOD, now, ...loads(2, 0, 0, 0.3, 1.1), bandwidth: 0 }) < 3) now += 500;
      waits.push((now - fell) / 1000);
    }
    expect(waits).toEqual([15, 30, 60, 120, 120, 120]);
  });
});
