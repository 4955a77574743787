import { expect, test } from "vitest";

import { Bandwidth } from "../src/net/bandwidth.ts";
import type { Transfer } from "../src/net/bandwidth.ts";

/** An answer that begins `wait` after it was asked for. */
function answered(bandwidth: Bandwidth, asked: number, wait = 0): Transfer {
  const transfer = bandwidth.begin(asked);
  transfer.answered(asked + wait);
  return transfer;
}

/** So many milliseconds of bytes at a rate, in pieces of ten. */
function fetchFor(transfer: Transfer, start: number, ms: number, bytesPerMs: number): number {
  for (let now = start + 10; now <= start + ms; now += 10) transfer.add(10 * bytesPerMs, now);
  return start + ms;
}

test("nothing is known before the first bytes", () => {
  const bandwidth = new Bandwidth();
  expect([bandwidth.bitsPerSecond, bandwidth.latency]).toEqual([0, 0]);
  answered(bandwidth, 0, 100).end(1000);
  expect([bandwidth.bitsPerSecond, bandwidth.latency]).toEqual([0, 100]);
});

test("a steady rate is what is measured, from the start and for ever", () => {
  const bandwidth = new Bandwidth();
  const transfer = answered(bandwidth, 0);
  let now = fetchFor(transfer, 0, 60, 50);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -1);
  now = fetchFor(transfer, now, 100_000, 50);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -1);
  transfer.end(now);
});

test("time in which nothing is asked for does not count", () => {
  const bandwidth = new Bandwidth();
  for (let k = 0; k < 50; k++) {
    const transfer = answered(bandwidth, k * 10_000);
    transfer.end(fetchFor(transfer, k * 10_000, 200, 50));
  }
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -1);
});

test("requests at once share the time", () => {
  const bandwidth = new Bandwidth();
  const transfers = [answered(bandwidth, 0), answered(bandwidth, 0)];
  for (let now = 10; now <= 10_000; now += 10) for (const transfer of transfers) transfer.add(250, now);
  for (const transfer of transfers) transfer.end(10_000);
  expect(bandwidth.bitsPerSecond).toBeCloseTo(400_000, -4);
});

test("the wait for an answer does not count, and the least of late is told", () => {
  const bandwidth = new Bandwidth();
  let now = 0;
  for (let k = 0; k < 100; k++) {
    const wait = k === 50 ? 900 : 200;
    const transfer = answered(bandwidth, now, wait);
    now = fetchFor(transfer, now + wait, 40, 125);
    transfer.end(now);
    if (k === 50) expect(bandwidth.latency).toBeGreaterThan(205);
  }
  expect(bandwidth.bitsPerSecond).toBeCloseTo(1_000_000, -1);
  expect(bandwidth.latency).toBe(200);
});

test("an answer that comes at once is no proof of endless bandwidth", () => {
  const bandwidth = new Bandwidth();
  const transfer = answered(bandwidth, 0, 90);
  transfer.add(16_384, 90);
  transfer.end(90);
  expect(bandwidth.bitsPerSecond).toBeCloseTo((16_384 * 8) / 0.02, -3);
});

test("a fall counts at once, a rise only when it lasts", () => {
  const bandwidth = new Bandwidth();
  const transfer = answered(bandwidth, 0);
  let now = fetchFor(transfer, 0, 30_000, 100);
  now = fetchFor(transfer, now, 4000, 10);
  expect(bandwidth.bitsPerSecond).toBeLessThan(0.4 * 800_000);
  now = fetchFor(transfer, now, 20_000, 10);
  now = fetchFor(transfer, now, 4000, 100);
  expect(bandwidth.bitsPerSecond).toBeLessThan(0.5 * 800_000);
  now = fetchFor(transfer, now, 30_000, 100);
  expect(bandwidth.bitsPerSecond).toBeGreaterThan(0.9 * 800_000);
});
