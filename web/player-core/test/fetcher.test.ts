// What is asked for, in how many requests, and what is kept of it.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { Fetcher } from "../src/net/fetcher.ts";
import type { When, Wish } from "../src/net/fetcher.ts";
import { sizeOfLayers } from "../src/format/links.ts";
import { Head } from "../src/format/reader.ts";
import { stream } from "./reel.ts";
import { pass } from "./rig.ts";
import { noise } from "./server.ts";
import { SlowSource } from "./slow_source.ts";

const FILE = stream(40, [25_000, 50_000]); // 100 groups, of 10 000 and 20 000 bytes
const HEAD = Head.parse(FILE);

let source: SlowSource;
let fetcher: Fetcher;
let failures: unknown[];
let wishes: Wish[];

beforeEach(() => {
  vi.useFakeTimers();
  source = new SlowSource(FILE, 1e6);
  failures = [];
  fetcher = new Fetcher(HEAD, source, { arrived: () => fetcher.want(wishes), failed: (error) => failures.push(error) }, 100_000);
});

afterEach(() => {
  fetcher.close();
  vi.useRealTimers();
});

function want(chunks: readonly number[], count = 2, when: When = "soon"): void {
  wishes = chunks.map((number) => ({ chunk: HEAD.chunks[number], count, when }));
  fetcher.want(wishes);
}

const wholeLayers = (chunks: readonly number[]): number[] => chunks.map((number) => fetcher.layersOf(HEAD.chunks[number]));
const bytesOf = (number: number, layers: number): Uint8Array => FILE.slice(HEAD.chunks[number].offset, HEAD.chunks[number].offset + sizeOfLayers(HEAD.chunks[number], layers));
const ranges = (): [number, number][] => source.reads.map(({ offset, length }) => [offset, offset + length]);

test("chunks that lie together come in one request, and each as soon as its last byte is there", async () => {
  want([3, 4, 5]);
  await pass(0.051);
  expect(wholeLayers([3, 4, 5])).toEqual([2, 0, 0]);
  await pass(1);
  expect(wholeLayers([3, 4, 5])).toEqual([2, 2, 2]);
  expect(ranges()).toEqual([[HEAD.chunks[3].offset, HEAD.chunks[6].offset]]);
  for (const number of [3, 4, 5]) expect(Buffer.compare(fetcher.payload(HEAD.chunks[number], 2), bytesOf(number, 2))).toBe(0);
});

test("layers that are left out are not fetched", async () => {
  want([3, 4, 5], 1);
  await pass(1);
  expect(source.sentBytes).toBe(30_000);
  expect(wholeLayers([3, 4, 5])).toEqual([1, 1, 1]);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[4], 1), bytesOf(4, 1))).toBe(0);
});

test("finer layers are fetched behind those at hand", async () => {
  want([7], 1);
  await pass(1);
  want([7], 2);
  await pass(1);
  const { offset } = HEAD.chunks[7];
  expect(ranges()).toEqual([[offset, offset + 10_000], [offset + 10_000, offset + 30_000]]);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[7], 2), bytesOf(7, 2))).toBe(0);
});

test("finer layers of a chunk whose first are on their way come behind these: none comes twice", async () => {
  wishes = [10, 11, 12].flatMap((number) => [1, 2].map((count) => ({ chunk: HEAD.chunks[number], count, when: "soon" as const })));
  fetcher.want(wishes.slice(0, 1));
  await pass(0.025);
  fetcher.want([...wishes, ...wishes]);
  await pass(1);
  expect(wholeLayers([10, 11, 12])).toEqual([2, 2, 2]);
  expect(source.sentBytes).toBe(90_000);
});

test("a payload is a copy: it may be given away", async () => {
  want([7]);
  await pass(1);
  const payload = fetcher.payload(HEAD.chunks[7], 2);
  structuredClone(payload, { transfer: [payload.buffer] });
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[7], 2), bytesOf(7, 2))).toBe(0);
});

test("what is not wanted any more is cancelled; what had come of it stays", async () => {
  want([10, 11, 12]);
  await pass(0.041);
  const sent = source.sentBytes;
  expect(sent).toBe(20_000);
  want([50]);
  await pass(1);
  expect(source.reads.map(({ state }) => state)).toEqual(["cancelled", "done"]);
  expect(wholeLayers([10, 50])).toEqual([1, 2]);
  want([10]);
  await pass(1);
  expect(source.reads.at(-1)!.offset).toBeGreaterThan(HEAD.chunks[10].offset + 10_000);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[10], 2), bytesOf(10, 2))).toBe(0);
});

test("a request whose next bytes are still wanted goes on", async () => {
  want([10, 11, 12]);
  await pass(0.03);
  want([10, 11, 12, 13]);
  want([10]);
  await pass(0.01);
  expect(source.reads.map(({ state }) => state)).toEqual(["open"]);
});

test("layers that are dropped in mid-request are not waited for", async () => {
  want([10, 11, 12]);
  await pass(0.045);
  expect(wholeLayers([10])).toEqual([1]);
  want([10, 11, 12], 1);
  await pass(1);
  expect(wholeLayers([10, 11, 12])).toEqual([1, 1, 1]);
  expect(source.sentBytes).toBeLessThan(50_000);
});

test("what the frame at the play head needs is asked for at once, wherever it lies; the rest one after the other", async () => {
  want([5, 30, 60], 2, "now");
  expect(source.reads).toHaveLength(3);
  await pass(2);
  source.bytesPerSecond = 100_000;
  want([70, 71, 72]);
  await pass(20);
  const before = source.reads.length;
  want([1, 20, 40, 80]);
  expect(source.reads).toHaveLength(before + 1);
  await pass(2);
  expect(wholeLayers([1, 20, 40, 80])).toEqual([2, 2, 2, 2]);
  expect(source.reads).toHaveLength(before + 4);
});

test("the next request is made before the last one ends, so that none waits for an answer", async () => {
  source.latencyMs = 90;
  want([1, 20, 40, 80, 90]);
  await pass(0.01);
  const begun = performance.now();
  await pass(0.8);
  expect(wholeLayers([1, 20, 40, 80, 90])).toEqual([2, 2, 2, 2, 2]);
  expect(performance.now() - begun).toBeLessThan(5 * (30 + 90) + 300);
});

test("a few bytes that are wanted later are collected first", async () => {
  want([5, 6], 2, "later");
  await pass(1);
  expect(source.reads).toHaveLength(0);
  want([5, 6, 7], 2, "later");
  await pass(1);
  expect(source.reads).toHaveLength(1);
  expect(wholeLayers([5, 6, 7])).toEqual([2, 2, 2]);
});

test("a request is about a second of what the network gives, and no more", async () => {
  want([0]);
  await pass(1);
  source.bytesPerSecond = 100_000;
  want([1, 2, 3]);
  await pass(60);
  want(Array.from({ length: 80 }, (_, k) => k + 10));
  await pass(0.1);
  expect(source.reads.at(-1)!.length).toBeLessThan(300_000);
  expect(source.reads.at(-1)!.length).toBeGreaterThanOrEqual(60_000);
});

test("bytes that nobody wants go, the oldest first, when they take too much", async () => {
  for (let number = 0; number < 20; number++) {
    want([number]);
    await pass(1);
    expect(fetcher.heldBytes).toBeLessThanOrEqual(100_000 + 30_000);
  }
  expect(wholeLayers([0, 15, 16, 17, 18, 19])).toEqual([0, 0, 2, 2, 2, 2]);
  want([0]);
  await pass(1);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[0], 2), bytesOf(0, 2))).toBe(0);
});

test("bytes that came with the head count", async () => {
  fetcher.put(FILE.slice(0, HEAD.chunks[1].offset + 500), 0);
  expect(wholeLayers([0, 1])).toEqual([2, 0]);
  want([0, 1]);
  await pass(1);
  expect(source.reads[0].offset).toBe(HEAD.chunks[1].offset + 500);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[1], 2), bytesOf(1, 2))).toBe(0);
});

test("bytes behind a hole are not taken for others", () => {
  fetcher.put(noise(5000), HEAD.chunks[4].offset + 100);
  expect(wholeLayers([4])).toEqual([0]);
  expect(fetcher.heldBytes).toBe(0);
  fetcher.put(FILE.slice(HEAD.chunks[4].offset, HEAD.chunks[5].offset), HEAD.chunks[4].offset);
  fetcher.put(noise(5000), HEAD.chunks[4].offset + 100);
  expect(Buffer.compare(fetcher.payload(HEAD.chunks[4], 2), bytesOf(4, 2))).toBe(0);
});

describe("a source that fails", () => {
  test("is told of once, for what was wanted", async () => {
    source.error = new Error("gone");
    want([5]);
    await pass(1);
    expect(failures).toEqual([source.error]);
  });

  test("after a cancel is not told of", async () => {
    want([5]);
    source.error = new Error("gone");
    wishes = [];
    fetcher.want(wishes);
    await pass(1);
    expect(failures).toEqual([]);
  });

  test("by ending early, without saying where the file ends, is told of", async () => {
    source = new SlowSource(FILE.slice(0, HEAD.chunks[5].offset + 10), 1e6);
    source.size = null;
    fetcher = new Fetcher(HEAD, source, { arrived: () => {}, failed: (error) => failures.push(error) }, 0);
    want([5]);
    await pass(1);
    expect(failures).toEqual([expect.objectContaining({ name: "SourceError" })]);
  });
});
