// What is damaged costs only itself: playback goes on, and says what it skips.

import { describe, expect, test } from "vitest";

import { FormatError, SourceError } from "../src/errors.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Player } from "../src/player.ts";
import { Head } from "../src/format/reader.ts";
import { BytesSource } from "../src/net/source.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { background, group, makeReel, stream } from "./reel.ts";
import { frames, pass, useRig } from "./rig.ts";
import { Viewer } from "./viewer.ts";

const FULL = [400, 800, 1600];
const FAST = 1e6;
const realNow = performance.now.bind(performance); // ms, whatever clock the tests turn

const rig = useRig();

async function play(seconds: number): Promise<void> {
  await Promise.all([rig.player.play(), pass(seconds)]);
}

/** With one bit of a chunk's last byte turned. */
function damaged(file: Uint8Array, ...chunks: number[]): Uint8Array {
  const copy = file.slice();
  for (const number of chunks) {
    const { offset, size } = Head.parse(file).chunks[number];
    copy[offset + size - 1] ^= 1;
  }
  return copy;
}

/** Which frames show an earlier frame of track 0 while it plays, and which one; null where they show none. */
function watchTrack(): Map<number, number | null> {
  const held = new Map<number, number | null>();
  const look = rig.viewer.look.bind(rig.viewer);
  rig.viewer.look = () => {
    look();
    const { frame, frames: shown, groups } = rig.viewer.shown ?? { frame: 0, frames: [0], groups: [] };
    if (groups[0] === null) held.set(frame, null);
    else if (shown[0] !== frame) held.set(frame, shown[0]);
  };
  return held;
}

describe("a damaged group", () => {
  test("is skipped with a warning, and playback goes on", async () => {
    rig.begin(damaged(stream(4, FULL), 3), FAST);
    const held = watchTrack();
    await play(6);
    expect(rig.viewer.warnings).toEqual(["chunk 3 (track 0, frames 30 to 39): a layer is damaged; it is skipped"]);
    expect(rig.viewer.frames).toEqual(frames(0, 100));
    expect([...held]).toEqual(frames(30, 40).map((frame) => [frame, 29]));
    expect(rig.player.stats).toMatchObject({ skippedGroups: 1, stalls: 0 });
    expect(rig.viewer.events).toContain("ended");
  });

  test("takes with it those that are predicted from it, up to the next that stands alone", async () => {
    rig.begin(damaged(stream(8, FULL, 5), 6), FAST);
    const held = watchTrack();
    await play(10);
    expect(rig.viewer.warnings).toEqual(["chunk 6 (track 0, frames 60 to 69): a layer is damaged; it is skipped, and 3 that need it"]);
    expect([...held]).toEqual(frames(60, 100).map((frame) => [frame, 59]));
    expect(rig.player.stats.skippedGroups).toBe(4);
    expect(rig.workers.chunks.filter((chunk) => chunk > 6 && chunk < 10)).toEqual([]);
  });

  test("is tried once in many rounds, and warned of once", async () => {
    rig.begin(damaged(stream(8, FULL), 3), FAST, { bufferSeconds: 1, decodedSeconds: 1 });
    rig.player.loop = true;
    await play(40);
    expect(rig.viewer.warnings).toHaveLength(1);
    expect(rig.workers.chunks.filter((chunk) => chunk === 3)).toHaveLength(1);
  });

  test("that is damaged in a fine layer is shown without that layer", async () => {
    rig.begin(damaged(stream(2, FULL), 0), FAST);
    void rig.player.load();
    await pass(0.3);
    expect(rig.viewer.shown?.groups[0]).toBeNull();
    rig.player.layers = 1;
    await pass(0.2);
    expect(rig.viewer.shown?.groups[0]).toMatchObject({ chunk: 0, layers: 1 });
    expect(rig.player.stats.skippedGroups).toBe(0);
  });

  test("that is sought holds the frame that was shown last, still, also from behind and in the next round", async () => {
    rig.begin(damaged(stream(4, FULL), 0, 3), FAST);
    rig.player.currentTime = 1.7; // frame 42
    void rig.player.load();
    await pass(0.5);
    rig.player.currentTime = 1.3; // frame 32 and a half
    await pass(0.5);
    expect(rig.viewer.shown).toMatchObject({ frame: 32, frames: [42], blend: 0, groups: [{ chunk: 4 }] });
    rig.player.currentTime = 2;
    rig.player.loop = true;
    const held = watchTrack();
    await play(2.5);
    expect([...held].slice(0, 10)).toEqual(frames(0, 10).map((frame) => [frame, 99]));
  });

  test("may be the first, or all of them", async () => {
    rig.begin(damaged(stream(2, FULL), 0, 1, 2, 3, 4), FAST);
    await play(3);
    expect(rig.viewer.events).toContain("ended");
    expect(rig.viewer.frames).toEqual(frames(0, 50));
    expect(rig.viewer.warnings).toHaveLength(5);
  });
});

/** Two bodies whose groups do not begin together, before a background that changes twice. */
function scene(): Uint8Array {
  const other = { track: 1 };
  return makeReel(
    [
      background(3000),
      group(10, [300, 300], { dependsOn: [0] }),
      group(4, [1], { ...other, form: Form.EMPTY }),
      group(11, [200, 200], other),
      background(500, [0]),
      group(10, [300, 300], { dependsOn: [4, 1] }),
      group(10, [200, 200], { ...other, dependsOn: [3] }),
      background(500, [4]),
      group(10, [300, 300], { dependsOn: [7, 5] }),
      group(5, [200, 200], { ...other, dependsOn: [6] }),
    ],
    { frameRate: 25 },
  );
}

describe("a scene", () => {
  test("shows all its bodies before the newest state of the background, decoded once", async () => {
    rig.begin(scene(), FAST);
    await play(3);
    expect(rig.viewer.frames).toEqual(frames(0, 30));
    expect(rig.viewer.warnings).toEqual([]);
    expect(rig.workers.chunks.sort((a, b) => a - b)).toEqual([0, 1, 3, 4, 5, 6, 7, 8, 9]);
    const statics = rig.workers.begun.filter(({ job }) => job.kind === "static");
    expect(new Set(statics.map(({ worker }) => worker)).size).toBe(1);
    expect(statics.map(({ job }) => job.previous)).toEqual([null, 0, 4]);
  });

  test("begun in its midst decodes the states that its background was changed from", async () => {
    rig.begin(scene(), FAST, { decodedSeconds: 0.1, bufferSeconds: 0.1 });
    rig.player.currentTime = 1;
    void rig.player.load();
    await pass(1);
    expect(rig.viewer.shown?.background?.chunk).toBe(7);
    expect(rig.workers.begun.filter(({ job }) => job.kind === "static").map(({ job }) => [job.chunk, job.stateOnly])).toEqual(
      [[0, true], [4, true], [7, false]],
    );
  });

  test("keeps its background in many rounds", async () => {
    rig.begin(scene(), FAST, { decodedSeconds: 0.2, bufferSeconds: 0.2 });
    rig.player.loop = true;
    await play(20);
    expect(rig.workers.chunks.filter((chunk) => chunk === 0)).toHaveLength(1);
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("whose background's change is damaged keeps the state before, and shows all its bodies", async () => {
    rig.begin(damaged(scene(), 4), FAST);
    rig.player.currentTime = 0.5;
    void rig.player.load();
    await pass(1);
    expect(rig.viewer.warnings).toEqual(["chunk 4 (static): a layer is damaged; it is skipped, and 1 that needs it"]);
    expect(rig.viewer.shown?.background).toBeNull();
    expect(rig.viewer.shown?.groups.map((group) => group?.chunk)).toEqual([5, 3]);
    rig.player.currentTime = 0;
    await pass(1);
    expect(rig.viewer.shown?.background?.chunk).toBe(0);
    rig.player.currentTime = 0.5;
    await pass(1);
    expect(rig.viewer.shown?.background?.chunk).toBe(0);
    expect(rig.player.stats.skippedGroups).toBe(0);
  });
});

describe("a truncated file", () => {
  test("is played without what is missing, and says so once", async () => {
    const file = stream(8, FULL, 5);
    const { offset } = Head.parse(file).chunks[12];
    rig.begin(file, FAST);
    rig.source.size = offset + 10;
    const held = watchTrack();
    await play(10);
    expect(rig.viewer.warnings).toEqual([
      `truncated, the file ends at byte ${offset + 10} of ${file.length}: chunk 12 (track 0, frames 120 to 129) and all behind it are missing, copy it again`,
    ]);
    expect([...held]).toEqual(frames(120, 200).map((frame) => [frame, 119]));
    expect(rig.source.reads.every((read) => read.offset + read.length <= offset || read.offset === 0)).toBe(true);
    rig.player.layers = 0;
    await pass(1);
    expect(rig.viewer.warnings).toHaveLength(1);
    expect(rig.player.stats.skippedGroups).toBe(8);
  });
});

describe("a worker", () => {
  /** The first worker that is asked for this chunk dies of it. */
  function dieOf(wanted: number): void {
    let isDead = false;
    rig.workers.onJob = (worker, { chunk }) => {
      if (chunk !== wanted || isDead) return "go on";
      isDead = true;
      setTimeout(() => worker.crash(), 1);
      return "say nothing";
    };
  }

  test("that dies is replaced, and what it did is skipped", async () => {
    dieOf(3);
    rig.begin(stream(8, FULL), FAST, { count: 1 });
    await play(10);
    expect(rig.viewer.warnings).toEqual(["chunk 3 (track 0, frames 30 to 39): its decoder crashed (out of memory); it is skipped"]);
    expect(rig.viewer.frames).toEqual(frames(0, 200));
    expect(rig.workers.workers).toHaveLength(2);
    expect(rig.workers.workers[0].isTerminated).toBe(true);
  });

  test("that dies takes states with it: another chain of its own is decoded again", async () => {
    const two = { track: 1 };
    const chunks = [group(10, FULL), group(10, FULL, two), group(10, FULL, { dependsOn: [0] }), group(10, FULL, { ...two, dependsOn: [1] })];
    dieOf(2);
    rig.begin(makeReel(chunks, { frameRate: 25 }), FAST, { count: 1 });
    await play(2);
    expect(rig.viewer.warnings).toEqual(["chunk 2 (track 0, frames 10 to 19): its decoder crashed (out of memory); it is skipped"]);
    expect(rig.viewer.frames).toEqual(frames(0, 20));
    expect(rig.workers.begun.map(({ job }) => [job.chunk, job.stateOnly])).toEqual(
      [[0, false], [1, false], [2, false], [1, true], [3, false]],
    );
  });

  test("that falls silent is replaced as well", async () => {
    rig.workers.onJob = (_, { chunk }) => (chunk === 1 ? "say nothing" : "go on");
    rig.begin(stream(4, FULL), FAST, { count: 2 });
    await play(60);
    expect(rig.viewer.warnings).toEqual(["chunk 1 (track 0, frames 10 to 19): its decoder crashed (no answer for 30 s); it is skipped"]);
    expect(rig.viewer.events).toContain("ended");
  });

  test("that has dropped a state gets the chain again, and nobody hears of it", async () => {
    rig.workers.mostStates = 3;
    rig.begin(stream(8, FULL, 10), FAST, { bufferSeconds: 1, decodedSeconds: 1 });
    await play(7);
    rig.player.currentTime = 1.3;
    await pass(1);
    expect(rig.viewer.warnings).toEqual([]);
    expect(rig.player.stats.skippedGroups).toBe(0);
    expect(rig.workers.begun.filter(({ job }) => job.stateOnly).length).toBeGreaterThan(2);
  });

  test("that drops every state at once costs the group, not the player", async () => {
    rig.workers.mostStates = 0;
    rig.begin(stream(4, FULL, 5), FAST);
    await play(6);
    expect(rig.viewer.events).toContain("ended");
    expect(rig.player.stats.skippedGroups).toBe(8);
    expect(rig.workers.begun.length).toBeLessThan(30);
  });

  test("that cannot be made ends it with an error, after some tries", async () => {
    rig.workers.startMs = 1e9;
    rig.begin(stream(4, FULL), FAST, { count: 2 });
    const played = rig.player.play();
    const failed = expect(played).rejects.toThrow("the decoder cannot be started");
    await pass(0.1);
    for (let k = 0; k < 3; k++) rig.workers.workers.at(-1)!.crash("no wasm here");
    await pass(0.1);
    await failed;
    expect(rig.viewer.errors.map(({ message }) => message)).toEqual(["the decoder cannot be started: no wasm here; load the page again"]);
    expect(rig.player.paused).toBe(true);
  });
});

describe("a source that gives up", () => {
  test("in mid-play ends it with one error; what was shown stays", async () => {
    rig.begin(stream(60, FULL), FAST, { bufferSeconds: 2 });
    await play(3);
    rig.source.error = new SourceError("gone");
    await pass(5);
    expect(rig.viewer.errors).toEqual([rig.source.error]);
    expect(rig.player).toMatchObject({ paused: true, seeking: false });
    expect(rig.viewer.shown?.groups[0]).not.toBeNull();
    expect(rig.viewer.events.slice(-2)).toEqual(["pause", "error"]);
    await expect(rig.player.play()).rejects.toBe(rig.source.error);
    const sent = rig.source.reads.length;
    rig.player.currentTime = 50;
    await pass(5);
    expect(rig.source.reads).toHaveLength(sent);
  });
});

describe("a head", () => {
  const whole = stream(4, FULL);
  const turned = whole.slice();
  turned[100] ^= 1;
  const future = whole.slice();
  future[8] = 2;
  const huge = whole.slice(0, 3000);
  new DataView(huge.buffer).setUint32(10, 0xffffffff, true);
  const long = whole.slice(0, 3000);
  new DataView(long.buffer).setUint32(10, 4000, true);
  const cases: [string, Uint8Array, RegExp][] = [
    ["of another kind of file", new TextEncoder().encode("<!doctype html><html></html>"), /^not a .reel file/],
    ["of no file at all", new Uint8Array(0), /^not a .reel file/],
    ["cut in its first bytes", whole.slice(0, 9), /^not a .reel file/],
    ["cut in its midst", whole.slice(0, 60), /truncated or damaged/],
    ["of a future version", future, /^format version 2: this player knows version 1/],
    ["with a bit turned", turned, /checksum/],
    ["of four gigabytes", huge, /a head of 4294967295 bytes, over 67108864/],
    ["longer than its file", long, /a head of 4000 bytes in a file of 3000: truncated or damaged/],
    ["of a shorter file", Uint8Array.from([...whole, 0]), /1 bytes behind the last chunk/],
  ];
  test.each(cases)("%s is refused, by the event and by the promises", async (_, bytes, message) => {
    rig.begin(whole, FAST);
    const workers = new FakeWorkers();
    const player = new Player({ source: new BytesSource(bytes), workers: workers.setup() });
    const viewer = new Viewer(player);
    const failures = Promise.allSettled([player.load(), player.play()]);
    await pass(1);
    for (const failure of await failures) expect(failure).toMatchObject({ status: "rejected", reason: expect.any(FormatError) as Error });
    expect(viewer.errors.map((error) => error.message)).toEqual([expect.stringMatching(message)]);
    expect(viewer.events).not.toContain("loadedmetadata");
    expect(player.info).toBeNull();
    viewer.stop();
    player.dispose();
  });

  test("of some kilobytes that tells of a million frames is opened at once, and of many more refused", async () => {
    const tell = (frames: number): Uint8Array => makeReel(Array.from({ length: 1000 }, () => group(frames, [1], { form: Form.EMPTY })), { frameRate: 25 });
    const file = tell(960);
    expect(() => Head.parse(tell(970))).toThrow("970000 frames of all tracks in a file of 14099 bytes, over 967871");
    rig.begin(file, FAST);
    const start = realNow();
    await play(1);
    rig.player.currentTime = rig.player.duration - 2;
    await pass(1);
    expect(realNow() - start).toBeLessThan(4000);
    expect(rig.player.info?.frameCount).toBe(960_000);
    expect(rig.player.currentFrame).toBeGreaterThan(959_000);
  });

  test("of very many chunks is read, their layers counted", async () => {
    const chunks = [...Array.from({ length: 130_000 }, () => group(1, [1])), group(1, [1, 1, 1])];
    rig.begin(makeReel(chunks, { frameRate: 25 }), FAST);
    await Promise.all([rig.player.load(), pass(5)]);
    expect(rig.player.info).toMatchObject({ frameCount: 130_001, mostLayers: 2 });
  });

  test("longer than the first request is read whole", async () => {
    const file = makeReel(Array.from({ length: 2000 }, () => group(1, [10, 10])), { frameRate: 25 });
    expect(Head.sizeOf(file)).toBeGreaterThan(16384);
    rig.begin(file, FAST);
    await play(3);
    expect(rig.player.info?.frameCount).toBe(2000);
    expect(rig.viewer.frames.length).toBeGreaterThan(60);
  });
});

test("a player that is disposed of in mid-load says nothing more", async () => {
  rig.begin(stream(4, FULL), 1000);
  const loaded = rig.player.load();
  const played = expect(rig.player.play()).rejects.toMatchObject({ name: "AbortError" });
  await pass(0.1);
  rig.player.dispose();
  await Promise.all([loaded, played, pass(60)]);
  expect(rig.viewer.events).toEqual(["play", "waiting"]);
  expect(rig.player.update(performance.now())).toBeNull();
});
