// Bytes by a network trace: as many as it has, when it has them, the same ones each time.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { rateAt, readTrace } from "../src/net/trace.ts";
import { TracedSource } from "../src/net/traced_source.ts";
import { Player } from "../src/player.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { stream } from "./reel.ts";
import { pass } from "./rig.ts";
import { noise } from "./server.ts";
import { Viewer } from "./viewer.ts";

const LATENCY = 40; // ms
const trace = (...rows: readonly string[]) => readTrace(["seconds,mbps", ...rows].join("\n"), "made.network.csv");
const MEGABIT = trace("0,1"); // 125 bytes a ms

beforeEach(() => void vi.useFakeTimers());
afterEach(() => {
  vi.restoreAllMocks();
  vi.useRealTimers();
});

describe("a network trace", () => {
  test("has comments, a head and rates by time, and begins again at its end", () => {
    const read = readTrace("# a comment\r\nseconds, mbps\r\n0,8\r\n2,0\r\n\r\n3,16\r\n", "x");
    expect(read).toEqual({ times: [0, 2, 3], rates: [1e6, 0, 2e6], duration: 4 });
    expect([0, 1.9, 2, 2.99, 3, 3.99, 4, 6.5].map((time) => rateAt(read, time))).toEqual([1e6, 1e6, 0, 0, 2e6, 2e6, 1e6, 0]);
    expect(trace("0,8").duration).toBe(1);
  });

  test.each([
    ["", 'line 1: "", but a network trace begins with seconds,mbps'],
    ["0,1\n1,2", 'line 1: "0,1", but a network trace begins with seconds,mbps'],
    ["seconds,mbps", "gives no byte at any time"],
    ["seconds,mbps\n0,0\n1,0", "gives no byte at any time"],
    ["seconds,mbps\n0,fast", 'line 2: "0,fast", but a row is seconds and Mbit/s'],
    ["seconds,mbps\n0,1\n1,-1", 'line 3: "1,-1", but a row is seconds and Mbit/s'],
    ["seconds,mbps\n0,1\n1,", 'line 3: "1,", but a row is seconds and Mbit/s'],
    ["seconds,mbps\n0,1,2", 'line 2: "0,1,2", but a row is seconds and Mbit/s'],
    ["seconds,mbps\n# late\n1,1", 'line 3: "1,1", but times begin with 0 and rise'],
    ["seconds,mbps\n0,1\n0,2", 'line 3: "0,2", but times begin with 0 and rise'],
  ])("that says %j is refused with its name, the line and the remedy", (text, message) => {
    expect(() => readTrace(text, "a.network.csv")).toThrow(`a.network.csv`);
    expect(() => readTrace(text, "a.network.csv")).toThrow(message);
  });
});

describe("a traced source", () => {
  /** Bytes of reads by time, ms: pairs of time and the sum of bytes that have come. */
  function counted(source: TracedSource, offset: number, length: number): { readonly sums: [number, number][]; readonly bytes: Uint8Array; readonly done: Promise<void> } {
    const found = { sums: [] as [number, number][], bytes: new Uint8Array(length), done: Promise.resolve() };
    const start = performance.now();
    let sum = 0;
    found.done = source.read(offset, length, (piece, at) => {
      found.bytes.set(piece, at - offset);
      found.sums.push([performance.now() - start, (sum += piece.length)]);
    });
    return found;
  }

  test("gives the bytes of the file at the rate of the trace", async () => {
    const file = noise(20_000, 1);
    const read = counted(new TracedSource(file, MEGABIT), 1000, 12_500);
    await pass(1);
    await read.done;
    expect(read.bytes).toEqual(file.subarray(1000, 13_500));
    for (const [time, sum] of read.sums) expect(sum).toBe(125 * (time - LATENCY));
    expect(read.sums.at(-1)).toEqual([LATENCY + 100, 12_500]);
  });

  test("stops where the trace has nothing, and goes on behind that", async () => {
    const read = counted(new TracedSource(noise(60_000, 1), trace("0,1", "0.2,0", "1,1")), 0, 60_000);
    await pass(0.9);
    expect(read.sums.at(-1)).toEqual([200, 125 * (200 - LATENCY)]);
    await pass(0.3);
    expect(read.sums.at(-1)).toEqual([1200, 125 * (400 - LATENCY)]);
  });

  test("shares its rate among reads, and a short one leaves the rest to the other", async () => {
    const source = new TracedSource(noise(50_000, 1), MEGABIT);
    const [long, short] = [counted(source, 0, 20_000), counted(source, 30_000, 5000)];
    await pass(1);
    await Promise.all([long.done, short.done]);
    expect(short.sums.at(-1)).toEqual([LATENCY + 80, 5000]);
    expect(long.sums.at(-1)).toEqual([LATENCY + 200, 20_000]);
  });

  test("loses what nobody asked for", async () => {
    const source = new TracedSource(noise(50_000, 1), MEGABIT);
    const first = counted(source, 0, 1250);
    await pass(10);
    await first.done;
    const second = counted(source, 0, 12_500);
    await pass(1);
    expect(second.sums.at(-1)).toEqual([LATENCY + 100, 12_500]);
  });

  test("gives a read that is cancelled nothing more, and the others all", async () => {
    const source = new TracedSource(noise(50_000, 1), MEGABIT);
    const controller = new AbortController();
    let came = 0;
    const cancelled = source.read(0, 25_000, (bytes) => void (came += bytes.length), controller.signal);
    const other = counted(source, 0, 12_500);
    await pass(0.06);
    controller.abort(new Error("not wanted any more"));
    await expect(cancelled).rejects.toThrow("not wanted any more");
    await pass(1);
    await other.done;
    expect(came).toBe(1250);
    expect(other.sums.at(-1)).toEqual([LATENCY + 110, 12_500]);
  });

  test("ends where the file does", async () => {
    const source = new TracedSource(noise(1000, 1), MEGABIT);
    const read = counted(source, 900, 5000);
    await pass(1);
    await read.done;
    expect([source.size, read.sums.at(-1)![1]]).toEqual([1000, 100]);
    await source.read(1000, 10, () => expect.unreachable());
  });

  /** A clock that goes on only every so many milliseconds, as timers of a busy page do. */
  function coarse(ms: number): void {
    vi.restoreAllMocks();
    const exact = performance.now.bind(performance);
    vi.spyOn(performance, "now").mockImplementation(() => Math.floor(exact() / ms) * ms);
  }

  test.each([1, 300])("measures the bandwidth of the trace, though timers ring up to %i ms late", async (late) => {
    coarse(late);
    const source = new TracedSource(noise(200_000, 1), MEGABIT);
    const read = counted(source, 0, 125_000);
    await pass(1.5);
    await read.done;
    expect(read.sums.some(([time, sum]) => sum > 125 * (time - LATENCY) + 1250)).toBe(false);
    expect(source.bandwidth).toBeCloseTo(1e6, -2);
    expect(source.latency).toBeCloseTo(LATENCY / 1000, 2);
  });

  /** Layers of each group when it was shown first, stalls and bytes of a recording of 20 s under a trace that falls to a tenth in between. */
  async function played(msOfDecoding: number, late: number): Promise<{ layers: number[]; stalls: number; bytes: number }> {
    coarse(late);
    const file = stream(20, [4000, 8000, 16000, 32000], 5);
    const workers = new FakeWorkers();
    workers.msOf = () => msOfDecoding;
    const player = new Player({ source: new TracedSource(file, trace("0,0.6", "6,0.06", "14,1")), workers: workers.setup(2) });
    const viewer = new Viewer(player, file);
    const layers: number[] = [];
    const look = setInterval(() => {
      const group = viewer.shown?.groups[0];
      if (group) layers[group.chunk] ??= group.layers;
    }, 5);
    await Promise.all([player.play(), pass(40)]);
    clearInterval(look);
    const found = { layers, stalls: player.stats.stalls, bytes: player.stats.fetchedBytes };
    viewer.stop();
    player.dispose();
    expect([viewer.offences, viewer.errors]).toEqual([[], []]);
    return found;
  }

  test("delivers the same layers again, nearly so on a machine that decodes five times slower, and fewer where the trace is slow", async () => {
    const first = await played(5, 1);
    expect(first.layers).toHaveLength(50);
    expect(new Set(first.layers).size).toBeGreaterThan(2);
    expect(await played(5, 1)).toEqual(first);
    const slower = await played(25, 10);
    const others = slower.layers.filter((layers, k) => layers !== first.layers[k]);
    expect([slower.layers.length, slower.stalls]).toEqual([50, first.stalls]);
    expect(others.length).toBeLessThanOrEqual(5); // the player decides by its clock: a group may come just in time, or just not
  });
});
