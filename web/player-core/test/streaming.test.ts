// Playback from a real web server in real time, honest or not.

import { afterEach, beforeEach, describe, expect, test } from "vitest";

import { slowTest } from "../../test/slow.ts";
import { HttpSource } from "../src/net/http_source.ts";
import { Player } from "../src/player.ts";
import { Head } from "../src/format/reader.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { stream } from "./reel.ts";
import { FileServer, Throttle } from "./server.ts";
import { Viewer } from "./viewer.ts";

const FULL = [20_000, 40_000, 80_000, 160_000]; // bytes a second of each layer
const RATE = 300_000; // of all
const SECONDS = 6;
const AGAIN = { retry: 2 }; // what must not stall in real time: a machine that halts for a moment stalls once, a fault of the player every time
const FILE = stream(SECONDS, FULL, 5);

let server: FileServer;
let workers: FakeWorkers;
let player: Player;
let viewer: Viewer;

beforeEach(async () => {
  workers = new FakeWorkers();
  await serve(FILE);
});

afterEach(async () => {
  viewer.stop();
  player.dispose();
  await server.close();
  expect(workers.offences).toEqual([]);
  expect(viewer.offences).toEqual([]);
  expect(viewer.alive.size).toBe(0);
});

async function serve(file: Uint8Array): Promise<void> {
  server = await FileServer.of(file);
  player = new Player({ source: new HttpSource(server.url, { retryMs: 10 }), workers: workers.setup(2) });
  viewer = new Viewer(player, file);
}

function throttle(bytesPerSecond: number): void {
  const limit = new Throttle(bytesPerSecond);
  server.respond = (response, asked) => limit.send(response, server.begin(response, asked));
}

async function ended(seconds = SECONDS + 4): Promise<void> {
  void player.play();
  await expect.poll(() => viewer.events.includes("ended") || viewer.events.includes("error"), { timeout: seconds * 1000, interval: 50 }).toBe(true);
}

/** Frames came in order, up to the last, and none was left out for long: this machine may be late with its pictures. */
function everyFrame(): void {
  expect(viewer.frames).toEqual([...new Set(viewer.frames)].sort((a, b) => a - b));
  expect(viewer.frames.at(-1)).toBe(25 * SECONDS - 1);
  expect(viewer.frames.length).toBeGreaterThan(0.7 * 25 * SECONDS);
}

describe("throttled", () => {
  slowTest("to twice the rate, it plays at best, without a stall", AGAIN, async () => {
    throttle(2 * RATE);
    await ended();
    expect(new Set(viewer.layersShown.slice(60))).toEqual(new Set([3])); // what came first was shown first
    everyFrame();
    expect(player.stats).toMatchObject({ stalls: 0, skippedGroups: 0, layers: 3 });
    expect(player.stats.bandwidthMbps).toBeGreaterThan((RATE * 8) / 1e6);
    expect(player.stats.bandwidthMbps).toBeLessThan((3 * RATE * 8) / 1e6);
  });

  test("to half the rate, it drops layers and no frames, without a stall", AGAIN, async () => {
    throttle(RATE / 2);
    await ended();
    everyFrame();
    expect(player.stats).toMatchObject({ stalls: 0, skippedGroups: 0 });
    const early = viewer.layersShown.slice(0, viewer.layersShown.length / 2); // the last groups get what the end leaves idle
    expect(Math.max(...early)).toBeLessThan(3);
    expect(Math.max(...early)).toBeGreaterThan(0);
  });

  test("it shows the first frame before a tenth of the file has come", async () => {
    throttle(RATE);
    void player.load();
    await expect.poll(() => viewer.shown?.frame, { interval: 10 }).toBe(0);
    expect(player.stats.fetchedBytes).toBeLessThan(FILE.length / 10);
  });

  test("a seek leaves what was on its way and shows the frame after its chain's bytes", async () => {
    throttle(RATE);
    player.layers = 3;
    void player.load();
    await expect.poll(() => viewer.shown?.frame, { interval: 10 }).toBe(0);
    await expect.poll(() => server.asked.length).toBeGreaterThan(1);
    const [before, requests] = [player.stats.fetchedBytes, server.asked.length];
    player.currentTime = 4.1;
    await expect.poll(() => viewer.shown?.frame, { interval: 10 }).toBe(102);
    expect(server.cut).toBeGreaterThan(0);
    const group = Head.parse(FILE).chunks[10];
    expect(server.asked[requests].from).toBe(group.offset);
    expect(player.stats.fetchedBytes - before).toBeLessThan(1.5 * group.size + 65536);
  });
});

describe("a server", () => {
  slowTest("that ignores ranges is played from one stream, as it arrives", AGAIN, async () => {
    const limit = new Throttle(2 * RATE);
    server.respond = async (response) => {
      response.writeHead(200, { "Content-Length": FILE.length });
      await limit.send(response, FILE);
    };
    void player.load();
    await expect.poll(() => viewer.shown?.frame, { interval: 10 }).toBe(0);
    expect(player.stats.fetchedBytes).toBeLessThan(FILE.length / 5);
    await ended();
    everyFrame();
    expect(server.asked).toHaveLength(1);
    expect(player.stats).toMatchObject({ layers: 3, stalls: 0 });
    expect(player.stats.fetchedBytes).toBe(FILE.length);
  });

  slowTest("that cuts connections in mid-stream is asked again: warnings, and every frame", AGAIN, async () => {
    server.respond = (response, asked, count) => {
      const body = server.begin(response, asked);
      if (count % 2 === 1) response.write(body.subarray(0, body.length / 3), () => response.destroy());
      else response.end(body);
    };
    await ended();
    everyFrame();
    expect(viewer.warnings.length).toBeGreaterThan(0);
    expect(viewer.warnings[0]).toMatch(/the connection was cut; trying again in/);
    expect(player.stats.stalls).toBe(0);
  });

  test("that fails three times and then is fine is waited for", async () => {
    server.respond = (response, asked, count) => {
      if (count < 3) response.writeHead(500).end();
      else response.end(server.begin(response, asked));
    };
    await player.play();
    expect(viewer.warnings).toHaveLength(3);
    expect(viewer.errors).toEqual([]);
  });

  test("without the file ends it with an error", async () => {
    server.respond = (response) => void response.writeHead(404).end();
    await expect(player.play()).rejects.toThrow(/not found \(404\)/);
    expect(viewer.errors).toHaveLength(1);
    expect(viewer.warnings).toEqual([]);
  });

  test("whose file is another one in mid-play ends it with an error, and no picture of both", async () => {
    const small = new Player({ source: new HttpSource(server.url, { retryMs: 10 }), workers: workers.setup(1), bufferSeconds: 1, decodedSeconds: 1 });
    const seen = new Viewer(small, FILE);
    await small.play();
    server.respond = (response, asked) => {
      response.setHeader("ETag", '"two"');
      response.writeHead(206, { "Content-Range": `bytes ${asked.from}-${asked.to - 1}/${FILE.length}`, ETag: '"two"' });
      response.end(server.bytes.subarray(asked.from, asked.to));
    };
    await expect.poll(() => seen.errors.length).toBe(1);
    expect(seen.errors[0].message).toContain("changed on the server");
    seen.stop();
    small.dispose();
    expect(seen.offences).toEqual([]);
  });

  slowTest("with a part of the file plays that part", async () => {
    await server.close();
    player.dispose();
    viewer.stop();
    const part = FILE.slice(0, Head.parse(FILE).chunks[5].offset + 100);
    server = await FileServer.of(part);
    player = new Player({ source: new HttpSource(server.url), workers: workers.setup(2) });
    viewer = new Viewer(player, FILE);
    await ended();
    expect(viewer.warnings).toHaveLength(1);
    expect(viewer.warnings[0]).toContain(`truncated, the file ends at byte ${part.length} of ${FILE.length}`);
    expect(player.stats.skippedGroups).toBe(10);
  });
});
