import { expect, test } from "vitest";
import { Bench, formatReport } from "../src/bench.ts";
import type { BenchExtra } from "../src/bench.ts";

const EXTRA: BenchExtra = { gpuBytes: 3 * 2 ** 20, triangles: 1234, userAgent: "a browser" };

/** Pictures that begin at these milliseconds and take `script` of them. */
function draw(bench: Bench, starts: readonly number[], script = 1): void {
  for (const start of starts) {
    bench.frameBegin(start);
    bench.frameEnd(start + script);
  }
}

const steady = (count: number, interval: number): number[] => Array.from({ length: count }, (_, k) => k * interval);

test("a bench of nothing says so", () => {
  const report = new Bench().report(EXTRA);
  expect(report).toMatchObject({ pictures: 0, seconds: 0, displayRate: null, dropped: 0, decodeLoad: null, triangles: 1234 });
  expect(report.scriptMs).toEqual({ median: null, most95: null });
  expect(formatReport(report)).toContain("JavaScript a picture: - ms");
});

test("median and 95 % of what pictures cost", () => {
  const bench = new Bench();
  for (let k = 0; k <= 100; k++) draw(bench, [20 * k], k / 10);
  const { scriptMs, intervalMs, pictures, seconds } = bench.report(EXTRA);
  expect(scriptMs.median).toBeCloseTo(5, 9);
  expect(scriptMs.most95).toBeCloseTo(9.5, 9);
  expect(intervalMs).toEqual({ median: 20, most95: 20 });
  expect(pictures).toBe(101);
  expect(seconds).toBeCloseTo(2, 9);
});

test("pictures are dropped against the display's rate, as it is told", () => {
  const bench = new Bench();
  draw(bench, steady(10, 1000 / 36)); // each a picture too late
  expect(bench.report({ ...EXTRA, displayRate: 72 })).toMatchObject({ displayRate: 72, dropped: 9 });
});

test("or as the shortest intervals tell it", () => {
  const bench = new Bench();
  const starts = steady(60, 10);
  draw(bench, [...starts, ...steady(5, 10).map((t) => t + 640)]); // from 590 to 640: four are missing
  const report = bench.report(EXTRA);
  expect(report.displayRate).toBeCloseTo(100, 6);
  expect(report.dropped).toBe(4);
});

test("an interruption is no dropped picture", () => {
  const bench = new Bench();
  draw(bench, steady(5, 10));
  bench.interrupt();
  draw(bench, steady(5, 10).map((t) => t + 60_000));
  expect(bench.report({ ...EXTRA, displayRate: 100 })).toMatchObject({ dropped: 0, pictures: 10 });
});

test("the load of decoding is its time over what it plays", () => {
  const bench = new Bench();
  bench.decoded(100, 0.4);
  bench.decoded(300, 0.4);
  const report = bench.report(EXTRA);
  expect(report.decodeLoad).toBeCloseTo(0.5, 9);
  expect(report.decodeMs.median).toBe(200);
  expect(report.groups).toBe(2);
});

test("begun anew it forgets pictures, and keeps what was decoded", () => {
  const bench = new Bench();
  draw(bench, steady(5, 10), 9);
  bench.decoded(100, 0.4);
  bench.restart();
  draw(bench, steady(3, 20).map((t) => t + 1000), 1);
  expect(bench.report(EXTRA)).toMatchObject({ pictures: 3, scriptMs: { median: 1, most95: 1 }, intervalMs: { median: 20, most95: 20 }, groups: 1 });
});

test("median and 95 % of what seeks take", () => {
  const bench = new Bench();
  expect(bench.report(EXTRA)).toMatchObject({ seeks: 0, seekMs: { median: null, most95: null } });
  for (const ms of [30, 10, 20]) bench.sought(ms);
  expect(bench.report(EXTRA)).toMatchObject({ seeks: 3, seekMs: { median: 20, most95: expect.closeTo(29, 9) as number } });
});

test("the last pictures are kept, and all are counted", () => {
  const bench = new Bench(4);
  draw(bench, steady(10, 10), 9);
  draw(bench, steady(4, 10).map((t) => t + 100), 1);
  expect(bench.report(EXTRA).scriptMs).toEqual({ median: 1, most95: 1 });
  expect(bench.report(EXTRA).pictures).toBe(14);
});

test("the text has every number", () => {
  const bench = new Bench();
  draw(bench, steady(73, 1000 / 72), 0.5);
  bench.decoded(50, 0.4);
  bench.sought(7);
  const text = formatReport(bench.report({ ...EXTRA, displayRate: 72, place: "VR", recording: "demo.reel", gpu: "a GPU" }));
  for (const part of ["demo.reel", "place: VR", "72.0 Hz", "73 in 1.0 s, 0 dropped", "0.50 / 0.50 ms", "13.89 / 13.89 ms", "50.00 / 50.00 ms, 1 groups",
    "12.5 %", "seek: 7.00 / 7.00 ms, 1 seeks", "triangles: 1234", "3.0 MiB", "GPU: a GPU", "browser: a browser"]) expect(text).toContain(part);
});
