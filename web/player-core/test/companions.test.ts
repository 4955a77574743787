// Chunks that add to others, as colours do: fetched and decoded with them, and never in their way.

import { describe, expect, test } from "vitest";

import { FormatError } from "../src/errors.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Links } from "../src/format/links.ts";
import { Head, describe as name } from "../src/format/reader.ts";
import { background, colors, group, makeReel } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";
import { frames, pass, useRig } from "./rig.ts";

const FULL = [400, 800, 1600];
const OF_COLORS = [50, 100, 200];
const FAST = 1e6;
const RATE = { frameRate: 25 };

const rig = useRig();

async function play(seconds: number): Promise<void> {
  await Promise.all([rig.player.play(), pass(seconds)]);
}

/** Groups of ten frames with colours, in chains: chunk 2 k is a group, the next one its colours. */
function colored(groups: number, chain = 1): Uint8Array<ArrayBuffer> {
  const chunks = Array.from({ length: groups }, (_, k): FakeChunk[] => {
    const isFirst = k % chain === 0;
    return [group(10, FULL, { dependsOn: isFirst ? [] : [2 * k - 2] }), colors(isFirst ? [2 * k] : [2 * k, 2 * k - 1], OF_COLORS)];
  });
  return makeReel(chunks.flat(), RATE);
}

function damaged(file: Uint8Array, number: number): Uint8Array {
  const copy = file.slice();
  const { offset, size } = Head.parse(file).chunks[number];
  copy[offset + size - 1] ^= 1;
  return copy;
}

/** Chunks that were begun with colours, and those without. */
function begun(): { readonly with: number[]; readonly without: number[] } {
  const jobs = rig.workers.begun.map(({ job }) => job);
  const numbers = (has: boolean): number[] => jobs.filter(({ companions }) => companions.length > 0 === has).map(({ chunk }) => chunk);
  return { with: numbers(true), without: numbers(false) };
}

describe("colours", () => {
  test("come with their groups in the same requests, and are decoded with them", async () => {
    const file = colored(12, 4);
    rig.begin(file, FAST);
    await play(6);
    expect(rig.viewer.warnings).toEqual([]);
    expect(rig.viewer.frames).toEqual(frames(0, 120));
    expect(begun()).toEqual({ with: frames(0, 12).map((k) => 2 * k), without: [] });
    expect(rig.source.reads.length).toBeLessThan(12);
    expect(rig.viewer.shown?.groups[0]?.colors).not.toBeNull();
    expect(rig.player.info?.hasColors).toBe(true);
    for (const { job } of rig.workers.begun) {
      expect(job.companions).toMatchObject([{ chunk: job.chunk + 1, kind: "colors", form: Form.VERTEX_COLORS }]);
      expect(job.companions[0].payload.length).toBe(350);
    }
  });

  test("of a group with fewer layers come with as many layers; those of a form without layers whole", async () => {
    const draco = { form: Form.DRACO };
    rig.begin(makeReel([group(10, FULL), colors([0], OF_COLORS), group(10, [300], draco), colors([2], [60])], RATE), FAST);
    rig.player.layers = 1;
    await play(1);
    expect(rig.workers.begun.map(({ job }) => job.companions.map(({ payload, ranges }) => [payload.length, ranges.length]))).toEqual([[[150, 2]], [[60, 1]]]);
    expect(rig.player.stats.mbps).toBeCloseTo((8 * (400 + 50 + 300 + 60)) / 0.8 / 1e6, 9); // with the layers of the last group
  });

  test("that are damaged are warned of once, and all that is predicted from them is shown without", async () => {
    rig.begin(damaged(colored(10, 5), 3), FAST, { count: 1 });
    await play(5);
    expect(rig.viewer.warnings).toEqual(["chunk 3 (colors, track 0, frames 10 to 19): a layer is damaged; it is skipped, and 3 that need it"]);
    expect(rig.viewer.frames).toEqual(frames(0, 100));
    expect(rig.player.stats).toMatchObject({ skippedGroups: 0, stalls: 0 });
    expect(begun().with.filter((chunk) => chunk > 4 && chunk < 10)).toEqual([]);
    expect(begun().with).toEqual(expect.arrayContaining([10, 12, 14, 16, 18]));
  });

  test("that are damaged in a fine layer come with fewer layers, and with the groups before", async () => {
    rig.begin(damaged(colored(2, 2), 1), FAST, { count: 1 });
    void rig.player.load();
    await pass(0.5);
    expect(rig.viewer.shown?.groups[0]).toMatchObject({ chunk: 0, colors: null });
    rig.player.layers = 1;
    await pass(0.5);
    expect(rig.viewer.shown?.groups[0]?.colors).not.toBeNull();
    expect(rig.viewer.warnings).toHaveLength(1);
    rig.player.currentTime = 0.6;
    await pass(0.5);
    expect(rig.viewer.shown?.groups[0]).toMatchObject({ chunk: 2, layers: 1 });
    expect(rig.viewer.shown?.groups[0]?.colors).not.toBeNull();
  });

  test("that a truncated file lacks leave the group before the cut as it is", async () => {
    const file = colored(4);
    const { offset } = Head.parse(file).chunks[5];
    rig.begin(file, FAST);
    rig.source.size = offset + 10;
    await play(3);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^truncated, .*: chunk 5 \(colors, track 0, frames 20 to 29\) and all behind it are missing/)]);
    expect(begun()).toEqual({ with: [0, 2], without: [4] });
    expect(rig.player.stats.skippedGroups).toBe(1);
  });

  test("of a background and of its changes are decoded with them; those of a change need those before", async () => {
    const still = { frames: 0 };
    const shown = [group(10, FULL, { dependsOn: [0] }), group(10, FULL, { dependsOn: [2] })];
    const file = makeReel([background(300), colors([0], [40], still), background(100, [0]), colors([2], [20], still), ...shown], RATE);
    rig.begin(damaged(file, 1), FAST, { count: 1 });
    await play(2);
    expect(rig.viewer.warnings).toEqual(["chunk 1 (colors, static): a layer is damaged; it is skipped, and 1 that needs it"]);
    expect(rig.viewer.frames).toEqual(frames(0, 20));
    expect(begun().with).toEqual([0]);
    expect(rig.viewer.shown?.background).toMatchObject({ chunk: 2, colors: null });
  });
});

test("chunks of kinds that the player does not know are neither fetched nor missed, whatever is in them", async () => {
  const future: FakeChunk = { kind: "future", form: 77, frames: 0, track: 900, dependsOn: [3, 8], layers: [200_000, 200_000] };
  const file = makeReel([future, group(10, FULL), { ...future, frames: 5 }, group(10, FULL, { dependsOn: [1] }), future], RATE);
  rig.begin(file, FAST);
  await play(2);
  expect(rig.viewer.warnings).toEqual([]);
  expect(rig.viewer.frames).toEqual(frames(0, 20));
  expect(rig.player.info).toMatchObject({ mostLayers: 2, hasColors: false, frameCount: 20 });
  expect(rig.source.reads.reduce((sum, { length }) => sum + length, 0)).toBeLessThan(30_000);
  expect(name(Head.parse(file).chunks[0])).toBe("chunk 0 (of another kind)");
});

describe("splats", () => {
  const laplacian = { form: Form.LAPLACIAN };
  const splats = (of: number): FakeChunk => ({ ...colors([of], OF_COLORS), kind: "splats", form: Form.GAUSSIANS });
  const chained = (): FakeChunk[] => [group(10, FULL), splats(0), group(10, FULL, { dependsOn: [0] }), group(10, [300], laplacian), splats(3)];
  const withSplats = (): number[] => rig.workers.begun.filter(({ job }) => job.companions.length > 0).map(({ job }) => job.chunk);

  test("come with the group that begins a chain, and with as many layers", async () => {
    rig.begin(makeReel(chained(), RATE), FAST, { count: 1 });
    rig.player.layers = 1;
    await play(2);
    expect(rig.viewer.warnings).toEqual([]);
    expect(rig.viewer.frames).toEqual(frames(0, 30));
    expect(rig.workers.begun.map(({ job }) => [job.chunk, ...job.companions.map(({ payload }) => payload.length)])).toEqual([[0, 150], [2], [3, 350]]);
    expect(rig.player.info).toMatchObject({ hasSplats: true, hasColors: false });
  });

  test("that are not wanted are neither fetched nor counted; wanted again, their chain is decoded again", async () => {
    rig.begin(makeReel(chained(), RATE), FAST, { count: 1 });
    rig.player.splats = false;
    await play(2);
    expect(withSplats()).toEqual([]);
    expect(rig.viewer.shown?.groups[0]?.splats).toBeNull();
    const rate = rig.player.stats.mbps;
    rig.player.splats = true;
    rig.player.currentTime = 0.5;
    await pass(1);
    expect(withSplats()).toContain(0);
    expect(rig.workers.chunks.filter((chunk) => chunk === 2)).toHaveLength(2);
    expect(rig.player.stats.mbps).toBeGreaterThan(rate);
    rig.player.currentTime = 0;
    await pass(1);
    expect(rig.viewer.shown?.groups[0]?.splats?.count).toBe(1);
  });

  test("that are damaged leave the surface", async () => {
    rig.begin(damaged(makeReel(chained(), RATE), 1), FAST);
    await play(2);
    expect(rig.viewer.warnings).toEqual(["chunk 1 (splats, track 0, frames 0 to 9): a layer is damaged; it is skipped"]);
    expect(rig.viewer.frames).toEqual(frames(0, 30));
    expect(rig.player.stats.skippedGroups).toBe(0);
  });
});

describe("the index", () => {
  const two = [group(10, FULL), group(10, FULL, { dependsOn: [0] })];
  const atlas: FakeChunk = { kind: "atlas", form: Form.PLACES, frames: 10, track: 0, dependsOn: [0], layers: [9] };
  const pictures: FakeChunk = { ...atlas, kind: "pictures", form: Form.VIDEO };
  const splats: FakeChunk = { ...atlas, kind: "splats", form: Form.GAUSSIANS };
  const draco = group(10, FULL, { form: Form.DRACO });
  const refused: [string, FakeChunk[], RegExp][] = [
    ["colours of nothing", [...two, colors([], [9])], /of undefined, which is no chunk before/],
    ["colours of a chunk behind them", [colors([1], [9]), ...two], /of 1, which is no chunk before/],
    ["colours of colours", [...two, colors([1], [9]), colors([2], [9])], /of 2, which is no chunk before/],
    ["two colours of a chunk", [...two, colors([1], [9]), colors([1], [9])], /of 1, which is no chunk before it, or has others/],
    ["colours of fewer frames", [...two, colors([1], [9], { frames: 9 })], /9 frames .* not those of chunk 1/],
    ["colours of another track", [...two, colors([1], [9], { track: 1 })], /track 1, which are not those of chunk 1/],
    ["colours of another form", [...two, colors([1], [9], { form: Form.LAYERS })], /form 2 .* not those of chunk 1/],
    ["colours predicted from none", [...two, colors([1, 0], [9])], /depends on 0$/],
    ["colours predicted from others than those before", [two[0], colors([0], [9]), group(10, FULL, { dependsOn: [] }), colors([2, 1], [9])], /depends on 1$/],
    ["an atlas of a predicted group", [...two, { ...atlas, dependsOn: [1] }], /of 1, that depends on $/],
    ["pictures predicted from those of the other rendition", [two[0], atlas, { ...pictures, kind: "compatible", dependsOn: [0, 1] }, two[1], { ...pictures, dependsOn: [3, 1, 2] }], /of 3, that depends on 1,2$/],
    ["pictures without an atlas", [...two, { ...pictures, dependsOn: [1] }], /of 1, that depends on $/],
    ["splats of a predicted group", [...two, { ...splats, dependsOn: [1] }], /of 1, that depends on $/],
    ["splats of a form without a mesh for all frames", [draco, splats], /of 0, that depends on $/],
    ["splats of another form", [two[0], { ...splats, form: Form.PLACES }], /form 7 .* not those of chunk 0/],
    ["splats that need others", [two[0], colors([0], [9]), { ...splats, dependsOn: [0, 1] }], /of 0, that depends on 1$/],
    ["splats of a background", [background(9), { ...splats, frames: 0 }, ...two], /of 0, that depends on $/],
    ["a group of the form of colours", [group(10, FULL, { form: Form.VERTEX_COLORS })], /of kind 2 and form 6/],
    ["a background of the form of colours", [{ ...background(10), form: Form.VERTEX_COLORS }, ...two], /of kind 1 and form 6/],
    ["a chunk of a future kind without bytes", [{ ...atlas, kind: "future", layers: [0] }, ...two], /without bytes/],
  ];
  test.each(refused)("with %s is refused", (_, chunks, message) => {
    expect(() => Head.parse(makeReel(chunks, RATE))).toThrow(FormatError);
    expect(() => Head.parse(makeReel(chunks, RATE))).toThrow(message);
  });

  test("may have colours, an atlas and pictures of groups, predicted or not", () => {
    const chunks = [two[0], colors([0], [9]), atlas, { ...pictures, dependsOn: [0, 2] }];
    const next = [group(10, FULL, { dependsOn: [0] }), colors([4, 1], [9]), { ...pictures, dependsOn: [4, 2, 3] }, group(10, FULL, { dependsOn: [4] }), colors([7], [9])];
    const head = Head.parse(makeReel([...chunks, ...next], RATE));
    const others = [...chunks, ...next].map((chunk) => (chunk.kind === "pictures" ? { ...chunk, kind: "compatible" as const } : chunk));
    expect(Head.parse(makeReel(others, RATE)).info).toMatchObject({ hasColors: true, hasTextures: true });
    const links = new Links(head);
    expect(head.chunks.map((chunk) => head.companionsOf(chunk).map(({ number }) => number))).toEqual([[1, 2, 3], [], [], [], [5, 6], [], [], [8], []]);
    expect(head.chunks.map((chunk) => links.previousOf(chunk)?.number ?? null)).toEqual([null, null, null, 2, 0, 1, 3, 4, null]);
  });
});
