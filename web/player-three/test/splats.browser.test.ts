// Splats in Chromium are those that are composited without a GPU, and what has no splats stays.

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { afterAll, afterEach, beforeAll, expect, test } from "vitest";
import { ChunkDecoder } from "@meshreel/player-core/decode/chunk_decoder";
import { Video } from "../../player-core/test/whole_video.ts";
import { Head } from "@meshreel/player-core/format/reader";
import { SPLATS_WIDTH, SPLAT_WEIGHT, SPLAT_WORDS } from "@meshreel/player-core/types";
import type { Packed, PackedGroup } from "@meshreel/player-core/types";
import { jobOf, noDamage } from "../../player-core/test/jobs.ts";
import { nodeCore } from "../../player-core/test/tools.ts";
import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import { ROOT } from "../../test/python.ts";
import { slowTest } from "../../test/slow.ts";
import { FLOOR_COLOR, makeFloor, makeGroup, RADIUS, SQUARE } from "./analytic.ts";
import type { Vector } from "../src/colors.ts";
import type { Mode } from "../src/modes.ts";
import { composite } from "./composite.ts";
import { Picture } from "./picture.ts";
import type {} from "./pages/splats.ts";

const [WIDTH, HEIGHT] = [320, 240]; // of a Picture
const [RED, GREEN] = [0xff0000ff, 0xff00ff00]; // opaque; red is the lowest byte

/** Round splats on each face of a sphere, as large as it is; `colorOf`: from the middle of a face in frame 0. */
function withSplats(packed: PackedGroup, colorOf: (middle: Vector) => number, copies = 1): PackedGroup {
  const { faces, texels, box } = packed;
  const count = (copies * faces.length) / 3;
  const words = new Uint32Array(4 * SPLATS_WIDTH * Math.ceil((SPLAT_WORDS * count) / (4 * SPLATS_WIDTH)));
  const third = Math.round(SPLAT_WEIGHT / 3);
  const at = (vertex: number, k: number): number => box.minimum[k] + (box.size[k] * texels[4 * vertex + k]) / 65535;
  for (let splat = 0; splat < count; splat++) {
    const corners = faces.subarray((3 * splat) % faces.length, ((3 * splat) % faces.length) + 3);
    const middle = [0, 1, 2].map((k) => (at(corners[0], k) + at(corners[1], k) + at(corners[2], k)) / 3) as unknown as Vector;
    words.set([...corners, third | (third << 16), 0, 0, colorOf(middle), 0], SPLAT_WORDS * splat);
  }
  const unit = 0.9 * RADIUS * Math.sqrt((4 * Math.PI) / (faces.length / 3)); // of the sphere's own faces
  return { ...packed, splats: { count, words, unit } };
}

describeInBrowser("splats in Chromium", () => {
  let open: OpenPage;
  beforeAll(async () => {
    open = await openPage(fileURLToPath(new URL("pages/splats.ts", import.meta.url)));
  });
  afterAll(async () => open?.close());
  afterEach(() => expect(open.errors).toEqual([]));

  const draw = (packed: readonly Packed[], mode: Mode, frame: number, [from, width, height]: readonly [Vector, number, number] = [[0, 0, 3], WIDTH, HEIGHT]): Promise<string> =>
    open.page.evaluate(([p, m, f, [x, y, z], w, h]) => {
      window.splatApi.size(w, h);
      window.splatApi.camera(x, y, z);
      return window.splatApi.draw(p, m, f);
    }, [packed, mode, frame, from, width, height] as const);

  test("are those that are composited without a GPU, in the frames of each group, but for rounding", async () => {
    const data = new Uint8Array(readFileSync(join(ROOT, "conformance/v1/splats/splats.reel")));
    const [head, core] = [Head.parse(data), await nodeCore()];
    const [decoder, video] = [new ChunkDecoder(core), new Video(core, data)];
    const groups = head.tracks[0].map((chunk) => decoder.decode(jobOf(head, chunk, data), noDamage) as PackedGroup);
    const { origin } = head.header;
    const [from, width, height] = [[0.7, 0.4, 1.1] as const, 120, 90];
    for (const frame of [0, 1, 2, 4, 5, 8]) {
      const group = groups.find(({ firstFrame, frameCount }) => frame < firstFrame + frameCount)!;
      const alone = { ...group, extra: new Uint32Array(0), extraStarts: new Uint32Array(group.frameCount + 1) };
      const drawn = Buffer.from(await draw([alone], "splats", frame, [from, width, height]), "base64");
      const bound = video.splats(frame)!.map((splat) => ({ ...splat, means: splat.means.map((value, k) => value - origin[k]) as never }));
      const wanted = composite(bound, from, width, height);
      const far = Array.from(wanted, (value, k) => Math.abs(value - drawn[4 * Math.floor(k / 3) + (k % 3)])).sort((a, b) => a - b);
      expect(wanted.filter((value) => value < 250).length / wanted.length, `frame ${frame}`).toBeGreaterThan(0.1);
      expect(far[Math.floor(0.99 * far.length)], `frame ${frame}`).toBeLessThan(5); // of 255: eight bits a layer
      expect(far.at(-1), `frame ${frame}`).toBeLessThan(40); // two at nearly the same depth
    }
  });

  test("cover what their mesh covers, and the nearer ones those behind them", async () => {
    const group = withSplats(makeGroup({ squareFrame: -1 }).packed, ([, , z]) => (z > 0 ? GREEN : RED));
    const mesh = new Picture(await draw([group], "tracks", 1));
    const splats = new Picture(await draw([group], "splats", 1));
    expect(splats.covered()).toBeGreaterThanOrEqual(mesh.covered());
    expect(splats.covered()).toBeLessThan(1.6 * mesh.covered());
    for (const [x, y] of [[0, 0], [0.2, 0], [-0.2, 0.1], [0, -0.25]]) expect(splats.at([-0.2 + x, y, 0])).toBeNear([0, 255, 0], 12);
    const behind = new Picture(await draw([group], "splats", 1, [[0, 0, -3], WIDTH, HEIGHT]));
    expect(behind.at([0.2, 0, 0])).toBeNear([255, 0, 0], 12);
  });

  test("leave patches and the background as they are, and show the background where they are transparent", async () => {
    const colored = withSplats(makeGroup({ isColored: true }).packed, () => 0x00ffffff); // none is opaque
    const scene = [colored, makeFloor(6, true).packed];
    const bare = new Picture(await draw([makeGroup({ squareFrame: -1, isColored: true }).packed, scene[1]], "color", 2));
    const [own, shown] = [new Picture(await draw(scene, "color", 2)), new Picture(await draw(scene, "splats", 2))];
    expect(shown.at(SQUARE)).toEqual(own.at(SQUARE));
    expect(shown.at([-0.85, -0.5, 0.9])).toEqual([...FLOOR_COLOR]);
    expect(shown.at([0.2, 0, 0])).toEqual([255, 255, 255]); // where the sphere was
    expect(shown.covered()).toBeLessThan(bare.covered());
    expect(new Picture(await draw([makeGroup({ isColored: true }).packed], "splats", 2)).difference(new Picture(await draw([makeGroup({ isColored: true }).packed], "color", 2)))).toBe(0);
  });

  test("of the nearer of two tracks are over those of the other, whichever comes first", async () => {
    const near = withSplats(makeGroup({ squareFrame: -1, center: () => [0, 0, 0.8] }).packed, () => GREEN);
    const far = withSplats(makeGroup({ track: 1, squareFrame: -1, center: () => [0.1, 0, -0.8] }).packed, () => RED);
    for (const both of [[near, far], [far, near]]) {
      const drawn = new Picture(await draw(both, "splats", 0));
      expect(drawn.at([0, 0, 0.8])).toBeNear([0, 255, 0], 12);
      expect(drawn.covered()).toBeGreaterThan(0.05);
    }
  });

  slowTest("of 40,000 are drawn by software, and cost this much (printed)", async () => {
    for (const [rings, copies] of [[45, 1], [71, 2]]) { // 8,100 and 20,164 faces
      const group = makeGroup({ squareFrame: -1, rings }).packed;
      const splatted = withSplats(group, ([x]) => (x > 0 ? 0x80ff8000 : 0x800080ff), copies);
      const { rate, sortMs, bytes, vertices } = await open.page.evaluate(([p, frames]) => {
        window.splatApi.size(1280, 720);
        return window.splatApi.measure(p, frames, 20);
      }, [[splatted], group.frameCount] as const);
      const sorted = [...sortMs].sort((a, b) => a - b);
      console.log(
        `${splatted.splats!.count} splats: ${vertices} vertices and ${Math.round(bytes)} bytes uploaded a picture, ordered in ${sorted[10].toFixed(1)} ms in a worker` +
          ` (at most ${sorted.at(-1)!.toFixed(1)}); ${rate.toFixed(1)} pictures a second of 1280 x 720 by software, each waiting for its order`,
      );
      expect(bytes).toBe(4 * splatted.splats!.count);
      expect(sorted[10]).toBeLessThan(1000 / 60);
    }
  }, 600_000);
});
