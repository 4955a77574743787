// The golden files, played from a web server by the real decoder.

import { readFileSync, readdirSync } from "node:fs";

import { afterEach, describe, expect, test } from "vitest";

import { HttpSource } from "../src/net/http_source.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Player } from "../src/player.ts";
import { Head } from "../src/format/reader.ts";
import { BytesSource } from "../src/net/source.ts";
import type { Packed, PackedGroup, Shown } from "../src/types.ts";
import { realWorkers } from "./real_workers.ts";
import { FileServer } from "./server.ts";
import { ROOT } from "./tools.ts";
import { Viewer } from "./viewer.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".reel")).map((name) => name.slice(0, -5));

interface Golden {
  readonly frames: { readonly faces: number }[];
  readonly frames_with_one_component?: { readonly faces: number }[];
}

let player: Player;
let viewer: Viewer;
let server: FileServer | null = null;

afterEach(async () => {
  viewer.stop();
  player.dispose();
  await server?.close();
  server = null;
  expect(viewer.offences).toEqual([]);
  expect(viewer.alive.size).toBe(0);
});

function open(file: Uint8Array, source = new BytesSource(file) as ConstructorParameters<typeof Player>[0]["source"]): void {
  player = new Player({ source, workers: realWorkers(2) });
  viewer = new Viewer(player, file, 200);
}

/** Triangles that a frame shows, the background's among them. */
function facesOf({ frame, groups, background }: Shown): number {
  const corners = groups.reduce((sum, group) => sum + (group === null ? 0 : cornersOf(group, frame)), 0);
  return (corners + (background?.faces.length ?? 0)) / 3;
}

function cornersOf({ faces, extraStarts, firstFrame }: PackedGroup, frame: number): number {
  return faces.length + extraStarts[frame - firstFrame + 1] - extraStarts[frame - firstFrame];
}

async function shownAt(frame: number, timeline: Head): Promise<Shown> {
  player.currentTime = timeline.timestamp(frame);
  await expect.poll(() => !player.seeking && player.update(performance.now())?.frame, { interval: 2 }).toBe(frame);
  return player.update(performance.now())!;
}

describe.each(NAMES)("%s", (name) => {
  const file = new Uint8Array(readFileSync(`${FOLDER}/${name}.reel`));
  const golden = JSON.parse(readFileSync(`${FOLDER}/${name}.json`, "utf8")) as Golden;
  const head = Head.parse(file);

  // In real time: a machine that halts for a moment stalls once.
  test("plays to its end from a web server, every frame with the faces that Python gives", { retry: 2 }, async () => {
    server = await FileServer.of(file);
    open(file, new HttpSource(server.url));
    const seen = new Map<number, number>();
    player.playbackRate = 0.5;
    const timer = setInterval(() => {
      if (viewer.shown) seen.set(viewer.shown.frame, facesOf(viewer.shown));
    }, 2);
    await player.play();
    await expect.poll(() => player.ended).toBe(true);
    clearInterval(timer);
    expect(viewer.warnings).toEqual([]);
    expect(player.stats).toMatchObject({ stalls: 0, skippedGroups: 0 });
    for (const [frame, faces] of seen) expect([frame, faces]).toEqual([frame, golden.frames[frame].faces]);
    expect(seen.size).toBeGreaterThan(golden.frames.length / 2);
    expect(server.asked).toHaveLength(1);
  });

  test("is the same wherever one seeks to, in whatever order", async () => {
    open(file);
    await player.load();
    const first = new Map<string, Packed>();
    for (let k = 0; k < 2 * golden.frames.length; k++) {
      const frame = (7 * k + Math.floor(k / golden.frames.length)) % golden.frames.length;
      const shown = await shownAt(frame, head);
      expect(facesOf(shown)).toBe(golden.frames[frame].faces);
      for (const packed of [...shown.groups, shown.background]) {
        if (packed === null) continue;
        const { texels, box } = first.get(`${packed.kind} ${packed.chunk}`) ?? packed;
        first.set(`${packed.kind} ${packed.chunk}`, packed);
        expect(packed.box).toEqual(box);
        expect(Buffer.compare(new Uint8Array(packed.texels.buffer), new Uint8Array(texels.buffer))).toBe(0);
      }
    }
    expect(viewer.warnings).toEqual([]);
  });

  test.runIf(golden.frames_with_one_component)("with one layer beyond the first has the faces that Python decodes", async () => {
    open(file);
    player.layers = 1;
    await player.load();
    for (let frame = 0; frame < golden.frames.length; frame++) {
      expect(facesOf(await shownAt(frame, head))).toBe(golden.frames_with_one_component![frame].faces);
    }
    expect(viewer.warnings).toEqual([]);
  });

  test.runIf(head.info.mostLayers > 0)("changes its number of layers by hand to and fro, in every frame", async () => {
    open(file);
    await player.load();
    for (let frame = golden.frames.length - 1; frame >= 0; frame -= 3) {
      for (const layers of [1, head.info.mostLayers, 0, head.info.mostLayers]) {
        player.layers = layers;
        player.currentTime = head.timestamp(frame);
        const wanted = head.tracks.map((_, track) => Math.min(layers, head.chunkOfFrame(frame, track).layers.length - 1));
        const layersShown = (): number[] => viewer.shown?.groups.map((group, track) => group?.layers ?? wanted[track]) ?? [];
        await expect.poll(() => viewer.shown?.frame === frame && layersShown(), { interval: 2 }).toEqual(wanted);
      }
      expect(facesOf(viewer.shown!)).toBe(golden.frames[frame].faces);
    }
    expect(viewer.warnings).toEqual([]);
  });

  test.runIf(head.chunks.some(({ form }) => form !== Form.EMPTY))("with any chunk damaged plays on, and skips what needs it", async () => {
    for (const chunk of head.chunks) {
      if (chunk.form === Form.EMPTY) continue; // nothing is read of an empty group
      const copy = file.slice();
      copy[chunk.offset + (chunk.size >> 1)] ^= 0x10;
      open(copy);
      player.layers = head.info.mostLayers;
      await player.load();
      for (let frame = 0; frame < golden.frames.length; frame += 2) await shownAt(frame, head);
      expect(viewer.warnings).toHaveLength(1);
      expect(viewer.warnings[0]).toMatch(new RegExp(`^chunk ${chunk.number} .* is skipped`));
      viewer.stop();
      player.dispose();
    }
  });
});

test("a decoder that cannot be loaded is an error that names it", async () => {
  const file = new Uint8Array(readFileSync(`${FOLDER}/layers.reel`));
  player = new Player({ source: new BytesSource(file), workers: { ...realWorkers(1), core: new ArrayBuffer(4) } });
  viewer = new Viewer(player, file);
  await expect(player.play()).rejects.toThrow(/^the decoder cannot be started: .*WebAssembly/);
  expect(viewer.errors).toHaveLength(1);
});
