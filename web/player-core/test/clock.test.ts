import { describe, expect, test } from "vitest";

import { Clock, Timeline } from "../src/time/clock.ts";

const STARTS = [0, 0.1, 0.15, 0.4, 0.5];
const TIMES = new Timeline(4, (frame) => STARTS[frame]);

describe("a timeline", () => {
  test.each([[-1, 0], [0, 0], [0.0999, 0], [0.1, 1], [0.149, 1], [0.15, 2], [0.3999, 2], [0.4, 3], [0.49, 3], [0.5, 3], [9, 3]])(
    "at %f s shows frame %i",
    (time, frame) => expect(TIMES.frameAt(time)).toBe(frame),
  );

  test("shows a frame at its own time, however that was reckoned", () => {
    const times = new Timeline(1000, (frame) => frame / 30);
    let sum = 0;
    for (let frame = 0; frame < 1000; frame++) {
      expect(times.frameAt(frame / 30)).toBe(frame);
      expect(times.frameAt(frame * (1 / 30))).toBe(frame);
      expect(times.frameAt(sum)).toBe(frame);
      sum += 1 / 30;
    }
  });

  test("blends from 0 at a frame's time to 1 at the next", () => {
    expect(TIMES.blendAt(0.1, 1)).toBe(0);
    expect(TIMES.blendAt(0.125, 1)).toBeCloseTo(0.5, 9);
    expect(TIMES.blendAt(0.2125, 2)).toBeCloseTo(0.25, 9);
    expect(TIMES.blendAt(0.0999999, 1)).toBe(0);
    expect(TIMES.blendAt(9, 3)).toBe(1);
  });

  test("of one frame works", () => {
    const one = new Timeline(1, (frame) => frame * 0.04);
    expect([one.frameAt(0), one.frameAt(1), one.duration, one.clamp(3)]).toEqual([0, 0, 0.04, 0.04]);
  });
});

describe("a clock", () => {
  const TEN = new Timeline(250, (frame) => frame / 25);

  function run(clock: Clock, from: number, to: number, stepMs = 10): void {
    for (let now = from; now <= to; now += stepMs) clock.advance(now);
  }

  test("moves by what passes between pictures, times its rate, from the first picture after it was started", () => {
    const clock = new Clock(TEN);
    run(clock, 0, 1000);
    expect(clock.time).toBe(0);
    clock.start();
    clock.advance(5000);
    expect(clock.time).toBe(0);
    run(clock, 5010, 6000);
    expect(clock.time).toBeCloseTo(1, 9);
    clock.rate = 2.5;
    run(clock, 6010, 7000);
    expect(clock.time).toBeCloseTo(3.5, 9);
    clock.stop();
    run(clock, 7010, 9000);
    expect(clock.time).toBeCloseTo(3.5, 9);
  });

  test("ends at the end", () => {
    const clock = new Clock(TEN);
    clock.start();
    run(clock, 0, 11_000);
    expect([clock.time, clock.isAtEnd]).toEqual([10, true]);
  });

  test("with loop goes on from the start, no time lost", () => {
    const clock = new Clock(TEN);
    clock.loop = true;
    clock.start();
    run(clock, 0, 25_000, 7);
    expect(clock.time).toBeCloseTo((Math.floor(25_000 / 7) * 7) / 1000 - 20, 6);
    expect(clock.isAtEnd).toBe(false);
  });

  test("in reverse goes down to the start, and with loop on from the end, no time lost", () => {
    const clock = new Clock(TEN);
    clock.direction = "reverse";
    clock.time = clock.begin();
    expect([clock.time, clock.isAtEnd]).toEqual([10, false]);
    clock.start();
    run(clock, 0, 3000);
    expect(clock.time).toBeCloseTo(7, 9);
    run(clock, 3010, 11_000);
    expect([clock.time, clock.isAtEnd]).toEqual([0, true]);
    clock.loop = true;
    run(clock, 11_007, 13_002, 7);
    expect(clock.time).toBeCloseTo(10 - 2.002 + 0.002, 2);
  });

  test("to and fro turns at the end, and at the start with loop, no time lost", () => {
    const clock = new Clock(TEN);
    clock.direction = "alternate";
    clock.start();
    run(clock, 0, 12_000);
    expect([clock.time, clock.isBack]).toEqual([expect.closeTo(8, 9), true]);
    run(clock, 12_010, 21_000);
    expect([clock.time, clock.isAtEnd]).toEqual([0, true]);
    clock.time = clock.begin();
    clock.loop = true;
    run(clock, 21_010, 44_000);
    expect([clock.time, clock.isBack]).toEqual([expect.closeTo(3, 9), false]);
  });

  test("a hold takes back a turn, too", () => {
    const clock = new Clock(TEN);
    clock.direction = "alternate";
    clock.time = 9.99;
    clock.start();
    clock.advance(0);
    clock.advance(30);
    expect(clock.isBack).toBe(true);
    clock.hold();
    expect([clock.time, clock.isBack]).toEqual([9.99, false]);
  });

  test("holds where it was at the picture before", () => {
    const clock = new Clock(TEN);
    clock.start();
    run(clock, 0, 1000);
    clock.advance(1033);
    clock.hold();
    expect(clock.time).toBeCloseTo(1, 9);
    run(clock, 1050, 2000);
    expect([clock.time, clock.isRunning]).toEqual([expect.closeTo(1, 9), false]);
  });

  test("stands still while nothing is displayed, and does not go back with the display's clock", () => {
    const clock = new Clock(TEN);
    clock.start();
    clock.advance(0);
    clock.advance(3_600_000);
    expect(clock.time).toBeLessThanOrEqual(0.5);
    const { time } = clock;
    clock.advance(10);
    expect(clock.time).toBe(time);
    clock.advance(30);
    expect(clock.time).toBeCloseTo(time + 0.02, 9);
  });
});
