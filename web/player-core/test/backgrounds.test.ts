// The slow videos of backgrounds: which picture a frame is shown with, which layers are fetched, and that nothing waits for them.

import { describe, expect, test, vi } from "vitest";

import { Form } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import { Fetcher } from "../src/net/fetcher.ts";
import { FakeDecoder, fakePacket, useFakeDecoder, video } from "./fake_decoder.ts";
import { background, colors, group, makeReel } from "./reel.ts";
import { pass, useRig } from "./rig.ts";

const FAST = 1e6;
const FRAMES = 10; // of a group
const LAYERS = [400, 800];

describe("the pictures of a background", () => {
  const rig = useRig();
  useFakeDecoder(rig);

  const [INTERVAL, LAYER, LAST] = [3, 64, 20]; // of a background's pictures: frames each, and how many in a layer and the last one

  /** Groups that are shown with a background whose pictures are numbered in their layer; layer 1's damaged one says so. */
  function slow(damaged = -1): Uint8Array<ArrayBuffer> {
    const records = [LAYER, LAYER, LAST].map((count, layer) => video(1, INTERVAL, Array.from({ length: count }, (_, t) => fakePacket(t, layer === 1 && t === damaged ? 1 : 0))));
    const still = { frames: 0, track: 0 };
    const body = Uint8Array.from(records.flatMap((record) => [...record]));
    const pictures = colors([0, 1], records.map(({ length }) => length), { ...still, kind: "pictures", form: Form.VIDEO, body });
    const groups = Array.from({ length: 45 }, () => group(FRAMES, LAYERS, { dependsOn: [0] }));
    return makeReel([background(500), colors([0], [20], { ...still, kind: "atlas", form: Form.PLACES }), pictures, ...groups], { frameRate: 25 });
  }

  const slowOf = (): number | undefined => (rig.viewer.shown?.backgroundImage as { frame?: number } | null)?.frame;

  test("go on slowly, from layer to layer, and stay behind the last", async () => {
    rig.begin(slow(), FAST);
    const look = rig.viewer.look.bind(rig.viewer);
    let checked = 0;
    rig.viewer.look = () => {
      look();
      const frame = rig.viewer.shown?.frame ?? 0;
      if (frame < 5 || rig.player.stats.backgroundLate) return;
      checked++;
      const picture = Math.min(Math.floor(frame / INTERVAL), 2 * LAYER + LAST - 1);
      expect(slowOf(), `frame ${frame}`).toBe(picture % LAYER);
    };
    await Promise.all([rig.player.play(), pass(20)]);
    expect(rig.viewer.frames).toEqual(Array.from({ length: 450 }, (_, k) => k));
    expect(checked).toBeGreaterThan(1000);
    expect(FakeDecoder.decoded.length).toBeLessThanOrEqual(2 * LAYER + LAST);
    expect(rig.player.stats).toMatchObject({ textures: "shown", stalls: 0, backgroundLate: false });
    expect(rig.viewer.warnings).toEqual([]);
  });

  test("are fetched by the layer that is shown", async () => {
    const file = slow();
    const { pieces } = Head.parse(file);
    const layers = pieces.filter(({ kind }) => kind === "pictures");
    const asked = vi.spyOn(Fetcher.prototype, "want");
    rig.begin(file, FAST, { bufferSeconds: 1, decodedSeconds: 1 });
    void rig.player.load();
    rig.player.currentTime = 250 / 25; // picture 83, of layer 1
    await pass(2);
    expect(slowOf()).toBe(83 - LAYER);
    const wanted = new Set(asked.mock.calls.flatMap(([wishes]) => wishes.map(({ chunk }) => chunk.offset)));
    expect(layers.map(({ offset }) => wanted.has(offset))).toEqual([false, true, false]);
    vi.restoreAllMocks();
  });

  test("that are late hold up nobody: the one before stays, and the statistics say so", async () => {
    rig.begin(slow(), FAST);
    void rig.player.load();
    await pass(1);
    expect(slowOf()).toBe(0);
    FakeDecoder.ms = 1000;
    await Promise.all([rig.player.play(), pass(2)]);
    expect(rig.player.stats).toMatchObject({ textures: "shown", stalls: 0, backgroundLate: true });
    expect(rig.viewer.shown!.frame).toBeGreaterThan(40);
    expect(slowOf()).toBeLessThan(5);
  });

  test("that are damaged leave its vertices' colours, and playback goes on", async () => {
    rig.begin(slow(10), FAST);
    await Promise.all([rig.player.play(), pass(20)]);
    expect(rig.viewer.frames.at(-1)).toBe(449);
    expect([slowOf(), rig.player.stats.textures]).toEqual([undefined, "damaged"]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk 2 \(pictures, static\): a damaged picture/)]);
  });
});
