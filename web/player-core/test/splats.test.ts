// Splats are where Python has them, and nonsense in their bytes is refused in words.

import { readFileSync } from "node:fs";

import { beforeAll, expect, test } from "vitest";

import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import { Video } from "./whole_video.ts";
import type { Core, Handle } from "../src/wasm/core.ts";
import type { Bound } from "./whole_video.ts";
import { FormatError } from "../src/errors.ts";
import { Head } from "../src/format/reader.ts";
import type { PackedGroup } from "../src/types.ts";
import { SPLAT_WEIGHT, SPLAT_WORDS } from "../src/types.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { noise } from "./server.ts";
import { ROOT, nodeCore } from "./tools.ts";

const FILE = new Uint8Array(readFileSync(`${ROOT}/conformance/v1/splats/splats.reel`));
const GOLDEN = JSON.parse(readFileSync(`${ROOT}/conformance/v1/splats/splats.json`, "utf8")) as Record<string, (Bound[] | null)[]>;
const EVERY = 50; // splats, of which the golden file tells one
const HEAD = Head.parse(FILE);
const COUNT = 7; // offset of the number of all splats

let core: Core;
beforeAll(async () => {
  core = await nodeCore();
});

/** All numbers, in the order of their names. */
function numbersOf({ means, axes, scales, opacities, colors }: Bound): number[] {
  return [...means, ...axes.flat(), ...scales, opacities, ...colors];
}

test.each([
  ["frames", null],
  ["frames_of_first_layers", 0],
] as const)("%s have their splats where Python has them", (name, layers) => {
  const video = new Video(core, FILE, layers);
  const { origin } = video.head.header;
  const hidden = GOLDEN[name].map((wanted, frame) => {
    const found = video.splats(frame);
    expect(found === null, `frame ${frame}`).toBe(wanted === null);
    if (found === null || wanted === null) return 0;
    const shown = found.filter((_, k) => k % EVERY === 0).map((splat) => ({ ...splat, means: splat.means.map((x, d) => x - origin[d]) as never }));
    expect(shown).toHaveLength(wanted.length);
    const far = shown.flatMap((splat, k) => numbersOf(splat).map((value, n) => Math.abs(value - numbersOf(wanted[k])[n])));
    expect(Math.max(...far)).toBeLessThan(1e-9);
    return shown.filter(({ opacities }) => opacities === 0).length;
  });
  if (layers === null) expect(Math.max(...hidden)).toBeGreaterThan(0);
});

/** Groups of the file as a worker packs them. */
function packed(data: Uint8Array): PackedGroup[] {
  const decoder = new ChunkDecoder(core);
  return HEAD.tracks[0].map((chunk) => decoder.decode(jobOf(HEAD, chunk, data), noDamage) as PackedGroup);
}

test("groups carry the splats of their chain, with their numbers and the frames that lack them", () => {
  const video = new Video(core, FILE);
  const groups = packed(FILE);
  expect(groups.map(({ splats }) => splats?.count ?? null)).toEqual([300, 300, 300, null]);
  for (const { splats, firstFrame, frameCount, vertexCount } of groups) {
    if (splats === null) continue;
    const { words, unit } = splats;
    const [floats, halves] = [new Float32Array(words.buffer), new Uint16Array(words.buffer)];
    for (let t = 0; t < frameCount; t++) {
      video.splats(firstFrame + t)!.forEach(({ opacities, scales, colors }, k) => {
        const at = SPLAT_WORDS * k;
        const lacking = words[at + 7] !== 0 && ((words[words[at + 7] + (t >> 5)] >> (t & 31)) & 1) === 1;
        expect(lacking ? 0 : Math.round(255 * opacities)).toBe(lacking ? opacities : words[at + 6] >>> 24);
        expect(unit * 2 ** (-((words[at + 5] >> 16) & 255) / 8)).toBeCloseTo(scales[0], 9);
        expect(words[at + 6] & 255).toBe(Math.round(255 * colors[0]));
        expect(Math.max(words[at], words[at + 1], words[at + 2])).toBeLessThan(vertexCount);
        expect(halves[2 * at + 6] + halves[2 * at + 7]).toBeLessThanOrEqual(SPLAT_WEIGHT);
        expect(Math.abs(floats[at + 4])).toBeLessThan(0.1);
      });
    }
  }
});

/** The group that the splats are on. */
function carriers(): Handle {
  const [chunk] = HEAD.chunks;
  const payload = FILE.slice(chunk.offset, chunk.offset + chunk.size);
  return core.open({ payload, frames: chunk.frameCount, layers: null, previous: null, isShown: true, scale: 1, origin: [0, 0, 0] });
}

test("what is changed in their bytes is refused in words, or decoded; what is cut off always but between layers", () => {
  const [chunk] = HEAD.chunks.filter(({ kind }) => kind === "splats");
  const data = FILE.slice(chunk.offset, chunk.offset + chunk.size);
  const [carrier, whole] = [carriers(), 300];
  let refused = 0;
  for (let seed = 0; seed < 400; seed++) {
    const copy = data.slice();
    const [where, high, value] = noise(3, 77 + seed);
    copy[(where * 256 + high) % (seed % 2 === 0 ? 40 : copy.length)] = value;
    try {
      core.dress(carrier, "splats", copy);
      const [, , , opacities, colors] = core.show(carrier, 0).splats;
      expect([...opacities, ...colors].every((x) => x >= 0 && x <= 1)).toBe(true);
    } catch (error) {
      expect(error).toBeInstanceOf(FormatError);
      refused++;
    }
  }
  expect(refused).toBeGreaterThan(200);
  const ends = new Set([0, 1, 2].map((k) => chunk.layers.slice(0, k + 1).reduce((sum, { size }) => sum + size, 0)));
  for (let end = 0; end < data.length; end += ends.has(end + 1) ? 1 : 7) {
    const cut = (): void => core.dress(carrier, "splats", data.subarray(0, end));
    if (!ends.has(end)) expect(cut).toThrow(FormatError);
    else {
      cut();
      expect(core.show(carrier, 0).splats[3].length).toBeLessThan(whole);
    }
  }
});

test("splats that are damaged are left out, and their group is shown without", () => {
  const job = jobOf(HEAD, HEAD.chunks[0], FILE);
  job.companions[0].payload[job.companions[0].payload.length - 1] ^= 1;
  const damage: string[] = [];
  const shown = new ChunkDecoder(core).decode(job, ({ message }) => damage.push(message)) as PackedGroup;
  expect(damage).toEqual([expect.stringContaining("layer 2 is damaged")]);
  expect([shown.splats, shown.faces.length > 0]).toEqual([null, true]);
});

test("a count that their bytes have no right to is refused before memory is taken", () => {
  const [chunk] = HEAD.chunks.filter(({ kind }) => kind === "splats");
  const data = [...FILE.subarray(chunk.offset, chunk.offset + chunk.size)];
  const many = [0x80, 0x80, 0x80, 0x80, 0x04]; // 2^30
  const second = COUNT + 2; // of the first layer: behind the two bytes of 300
  const claimed = Uint8Array.from([...data.slice(0, second), ...many, ...data.slice(second + 1)]);
  expect(() => core.dress(carriers(), "splats", claimed)).toThrow(FormatError);
  const fewer = Uint8Array.from(data);
  fewer[COUNT] -= 1;
  expect(() => core.dress(carriers(), "splats", fewer)).toThrow(/more or fewer/);
});
