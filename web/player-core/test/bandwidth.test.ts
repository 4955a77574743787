import { expect, test } from "vitest";

import { Bandwidth } from "../src/net/bandwidth.ts";

/** So many milliseconds of bytes at a rate, in pieces of ten. */
function fetchFor(bandwidth: Bandwidth, start: number, ms: number, bytesPerMs: number): number {
  for (let now = start + 10; now <= start + ms; now += 10) bandwidth.add(10 * bytesPerMs, now);
  return start + ms;
}

test("nothing is known before the first bytes", () => {
  const bandwidth = new Bandwidth();
  expect(bandwidth.bitsPerSecond).toBe(0);
  bandwidth.begin(0);
  bandwidth.end(1000);
  expect(bandwidth.bitsPerSecond).toBe(0);
});

test("a steady rate is what is measured, from the start and for ever", () => {
  const bandwidth = new Bandwidth();
  bandwidth.begin(0);
  let now = fetchFor(bandwidth, 0, 60, 50);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(480_000, -4); // its first piece came in no time
  now = fetchFor(bandwidth, now, 100_000, 50);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -1);
  bandwidth.end(now);
});

test("time in which nothing is asked for does not count", () => {
  const bandwidth = new Bandwidth();
  for (let k = 0; k < 50; k++) {
    const start = k * 10_000;
    bandwidth.begin(start);
    bandwidth.end(fetchFor(bandwidth, start, 200, 50));
  }
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -4);
});

test("requests at once share the time", () => {
  const bandwidth = new Bandwidth();
  bandwidth.begin(0);
  bandwidth.begin(0);
  for (let now = 10; now <= 10_000; now += 10) {
    bandwidth.add(250, now);
    bandwidth.add(250, now);
  }
  bandwidth.end(10_000);
  bandwidth.end(10_000);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -4);
});

test("the wait for the first answer does not count, that for later ones does", () => {
  const bandwidth = new Bandwidth();
  bandwidth.begin(0);
  let now = fetchFor(bandwidth, 5000, 1000, 50);
  bandwidth.end(now);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -4);
  for (let k = 0; k < 100; k++) {
    bandwidth.begin(now);
    now = fetchFor(bandwidth, now + 100, 100, 50); // a hundred to wait, a hundred to read
    bandwidth.end(now);
  }
  expect(bandwidth.bitsPerSecond).toBeCloseTo(200_000, -4);
});

test("a first answer that comes at once is no proof of endless bandwidth", () => {
  const bandwidth = new Bandwidth();
  bandwidth.begin(0);
  bandwidth.add(16_384, 90);
  bandwidth.end(90);
  expect(bandwidth.bitsPerSecond).toBeCloseTo((16_384 * 8) / 0.02, -3);
});

test("a fall counts at once, a rise only when it lasts", () => {
  const bandwidth = new Bandwidth();
  bandwidth.begin(0);
  let now = fetchFor(bandwidth, 0, 30_000, 100);
  now = fetchFor(bandwidth, now, 4000, 10);
  expect(bandwidth.bitsPerSecond).toBeLessThan(0.4 * 800_000);
  now = fetchFor(bandwidth, now, 20_000, 10);
  now = fetchFor(bandwidth, now, 4000, 100);
  expect(bandwidth.bitsPerSecond).toBeLessThan(0.5 * 800_000);
  now = fetchFor(bandwidth, now, 30_000, 100);
  expect(bandwidth.bitsPerSecond).toBeGreaterThan(0.9 * 800_000);
});
