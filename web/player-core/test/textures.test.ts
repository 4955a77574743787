// The textures of bodies: pictures in step with frames, from which video, and what is shown without. A stand-in decodes: Node has no WebCodecs.

import { describe, expect, test, vi } from "vitest";

import { Form } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import { Fetcher } from "../src/net/fetcher.ts";
import type { Rendition, Shown } from "../src/types.ts";
import { FakeDecoder, fakePacket, useFakeDecoder, video } from "./fake_decoder.ts";
import { colors, group, makeReel } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";
import { pass, useRig } from "./rig.ts";

const FAST = 1e6;
const FRAMES = 10; // of a group
const LAYERS = [400, 800];

describe("pictures", () => {
  const rig = useRig();
  useFakeDecoder(rig);

  /** Chains of `chain` groups with textures; the packet of a damaged frame says so. */
  function textured(groups: number, chain: number, { damaged = -1, kinds = ["pictures"] }: { damaged?: number; kinds?: readonly Rendition[] } = {}): Uint8Array<ArrayBuffer> {
    const chunks: FakeChunk[] = [];
    let [before, atlas] = [-1, -1];
    const last = new Map<Rendition, number>();
    for (let k = 0; k < groups; k++) {
      const number = chunks.length;
      const isFirst = k % chain === 0;
      chunks.push(group(FRAMES, LAYERS, { dependsOn: isFirst ? [] : [before] }));
      if (isFirst) atlas = chunks.push(colors([number], [20], { kind: "atlas", form: Form.PLACES })) - 1;
      const packets = Array.from({ length: FRAMES }, (_, t) => fakePacket(FRAMES * k + t, FRAMES * k + t === damaged ? 1 : 0));
      for (const kind of kinds) {
        const body = video(kind === "pictures" ? 1 : 2, 1, packets);
        const dependsOn = isFirst ? [number, atlas] : [number, atlas, last.get(kind)!];
        last.set(kind, chunks.push(colors(dependsOn, [body.length], { kind, form: Form.VIDEO, body })) - 1);
      }
      before = number;
    }
    return makeReel(chunks, { frameRate: 25 });
  }

  const frameOf = (shown: Shown | null): number | undefined => (shown?.images[0] as { frame?: number } | null | undefined)?.frame;

  /** Looks at each picture that is shown: a texture is that of its frame, and open. */
  function watch(from = 0): void {
    const look = rig.viewer.look.bind(rig.viewer);
    rig.viewer.look = () => {
      look();
      const { shown } = rig.viewer;
      const image = shown?.images[0];
      if (shown && shown.frame >= from) expect(frameOf(shown)).toBe(shown.frame);
      if (image) expect(FakeDecoder.open.has(image as never)).toBe(true);
    };
  }

  test.each([["reverse", 5], ["alternate", 5], ["alternate", 30]] as const)("in %s are a few of each group, of no other group and none missing, and come in time: a picture in %i ms", async (direction, ms) => {
    FakeDecoder.ms = ms;
    rig.begin(textured(6, 3), FAST);
    Object.assign(rig.player, { direction, loop: true });
    const behind: number[] = [];
    const look = rig.viewer.look.bind(rig.viewer);
    rig.viewer.look = () => {
      look();
      const { shown } = rig.viewer;
      if (frameOf(shown) === undefined) return expect(behind.length).toBe(0); // before the first
      behind.push(shown!.frame - frameOf(shown)!);
      expect(Math.floor(shown!.frame / FRAMES)).toBe(Math.floor(frameOf(shown)! / FRAMES));
    };
    await Promise.all([rig.player.play(), pass(12)]);
    expect(rig.viewer.frames.length).toBeGreaterThan(ms > 5 ? 50 : 250);
    expect(behind.length).toBeGreaterThan(500);
    expect(new Set(behind)).toEqual(new Set([0, 1, 2]));
    if (ms === 5) expect(rig.player.stats.stalls).toBe(0); // a chain of 30 in 0.4 s
    expect(rig.player.stats).toMatchObject({ textures: "shown" });
  });

  test("come with the layers that need them: until they are decoded a loop goes on without, and does not wait", async () => {
    rig.begin(textured(2, 2), FAST);
    rig.player.loop = true;
    rig.player.layers = 0;
    await Promise.all([rig.player.play(), pass(2)]);
    expect([rig.viewer.shown?.groups[0]?.layers, rig.player.stats.textures]).toEqual([0, "left out"]);
    rig.player.layers = "auto";
    await pass(3);
    const { shown } = rig.viewer;
    expect([shown?.groups[0]?.layers, frameOf(shown), rig.player.stats.textures]).toEqual([1, shown?.frame, "shown"]);
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("are those of their frames, decoded once each, a few ahead", async () => {
    rig.begin(textured(4, 2), FAST);
    watch();
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.frames).toEqual(Array.from({ length: 40 }, (_, k) => k));
    expect(FakeDecoder.decoded).toEqual(rig.viewer.frames);
    expect(FakeDecoder.most).toBeLessThanOrEqual(8);
    expect(rig.player.stats).toMatchObject({ textures: "shown", stalls: 0 });
  });

  test("come from the key of their chain after a seek, to and fro, and in a loop", async () => {
    rig.begin(textured(4, 2), FAST);
    watch();
    void rig.player.load();
    for (const frame of [15, 3, 39, 14, 0]) {
      rig.player.currentTime = frame / 25;
      await pass(1);
      expect([rig.player.seeking, frameOf(rig.viewer.shown)]).toEqual([false, frame]);
    }
    rig.player.loop = true;
    rig.player.playbackRate = 2;
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.player.stats.stalls).toBe(0);
  });

  test("that are damaged leave the colours of vertices until the next key", async () => {
    rig.begin(textured(4, 2, { damaged: 12 }), FAST);
    watch(20);
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk \d+ \(pictures, track 0, frames (0 to 9|10 to 19)\): a damaged picture/)]);
    expect(rig.viewer.frames.at(-1)).toBe(39);
  });

  test.each([
    ["unsupported", /decodes no AV1/, { supported: /avc1/ }],
    ["damaged", /a picture of 64 x 30: not the atlas' 64 x 32/, { height: 30 }],
    ["slow", /too slowly/, { ms: 120 }],
  ] as const)("that are %s are warned of, and playback goes on", async (state, warning, change) => {
    Object.assign(FakeDecoder, change);
    rig.begin(textured(2, 2), FAST);
    await Promise.all([rig.player.play(), pass(8)]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(warning)]);
    expect(rig.viewer.frames.at(-1)).toBe(19);
    expect(rig.player.stats.textures).toBe(state);
  });

  test.each([
    ["AV1", "", /./, /^av01/],
    ["H.264", "this browser decodes no AV1", /^avc1/, /^avc1/],
  ] as const)("are %s where a file has both and that is the first the browser decodes, and nothing of the other is fetched", async (codec, reason, supported, used) => {
    FakeDecoder.supported = supported;
    const file = textured(4, 2, { kinds: ["pictures", "compatible"] });
    const other = Head.parse(file).chunks.filter(({ kind }) => kind === (codec === "AV1" ? "compatible" : "pictures"));
    const payload = vi.spyOn(Fetcher.prototype, "payload");
    const wanted = vi.spyOn(Fetcher.prototype, "want");
    rig.begin(file, FAST);
    watch();
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.frames.at(-1)).toBe(39);
    expect((rig.viewer.shown!.images[0] as unknown as { codec: string }).codec).toMatch(used);
    expect(rig.player.stats).toMatchObject({ textures: "shown", textureCodec: codec, textureReason: reason });
    const named = new Set([...payload.mock.calls.map(([chunk]) => chunk), ...wanted.mock.calls.flatMap(([wishes]) => wishes.map(({ chunk }) => chunk))].map(({ number }) => number));
    expect(other.filter(({ number }) => named.has(number))).toEqual([]);
    expect(rig.viewer.warnings).toEqual([]);
    vi.restoreAllMocks();
  });

  test("are H.264 where AV1 is too slow, and are tried again where all were", async () => {
    FakeDecoder.msOf = (codec) => (codec.startsWith("av01") ? 200 : 5);
    rig.begin(textured(6, 2, { kinds: ["pictures", "compatible"] }), FAST);
    await Promise.all([rig.player.play(), pass(10)]);
    expect(rig.player.stats).toMatchObject({ textures: "shown", textureCodec: "H.264", textureReason: "this machine decodes AV1 too slowly" });
    expect(rig.viewer.warnings).toEqual([]);
    FakeDecoder.msOf = () => 200;
    rig.player.loop = true;
    await Promise.all([rig.player.play(), pass(10)]);
    expect(rig.player.stats).toMatchObject({ textures: "slow", textureCodec: null });
    FakeDecoder.msOf = () => 5;
    await pass(20);
    expect(rig.player.stats).toMatchObject({ textures: "shown", textureCodec: "H.264" });
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/too slowly/)]);
  });

  test("of a decoder that the browser refuses after all leave the other video, then the colours of vertices", async () => {
    vi.spyOn(FakeDecoder.prototype, "configure").mockImplementation(function (this: FakeDecoder) {
      const { init } = this as unknown as { init: { error(error: Error): void } };
      setTimeout(() => init.error(Object.assign(new Error("none"), { name: "NotSupportedError" })));
    });
    rig.begin(textured(2, 2, { kinds: ["pictures", "compatible"] }), FAST);
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.frames.at(-1)).toBe(19);
    expect(rig.player.stats).toMatchObject({ textures: "unsupported", textureReason: "this browser decodes no H.264 of that size" });
    vi.restoreAllMocks();
  });

  test.each([
    ["fewer than frames", 1, 1, FRAMES - 1],
    ["slow ones", 1, 2, FRAMES],
    ["those of another codec", 2, 1, FRAMES],
  ] as const)("of a body that are %s are refused, and the colours of vertices are shown", async (_, codec, interval, count) => {
    const body = video(codec, interval, Array.from({ length: count }, (_, t) => fakePacket(t)));
    const chunks = [group(FRAMES, LAYERS), colors([0], [20], { kind: "atlas", form: Form.PLACES }), colors([0, 1], [body.length], { kind: "pictures", form: Form.VIDEO, body })];
    rig.begin(makeReel(chunks, { frameRate: 25 }), FAST);
    await Promise.all([rig.player.play(), pass(2)]);
    expect([rig.viewer.frames.at(-1), frameOf(rig.viewer.shown), rig.player.stats.textures]).toEqual([FRAMES - 1, undefined, "damaged"]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk 2 .*pictures of codec/)]);
  });

  test("of a body that is far are not decoded, and come back without a stall when it is near", async () => {
    const asked = vi.spyOn(Fetcher.prototype, "want");
    rig.begin(textured(10, 10), FAST, { bufferSeconds: 1, decodedSeconds: 1 });
    rig.viewer.far.add(0);
    await Promise.all([rig.player.play(), pass(1)]);
    const early = asked.mock.calls.slice(5).flatMap(([wishes]) => wishes.map(({ chunk }) => chunk.kind)); // the first were made before a picture was
    expect(early.length > 0 && !early.includes("pictures")).toBe(true);
    vi.restoreAllMocks();
    expect([frameOf(rig.viewer.shown), rig.player.stats.textures, FakeDecoder.decoded]).toEqual([undefined, "far", []]);
    rig.viewer.far.clear();
    await pass(1);
    const { shown } = rig.viewer;
    expect(shown!.frame).toBeGreaterThan(40);
    expect([frameOf(shown), rig.player.stats.textures, rig.player.stats.stalls]).toEqual([shown!.frame, "shown", 0]);
    rig.viewer.far.add(0);
    await pass(0.5);
    expect([frameOf(rig.viewer.shown), FakeDecoder.open.size]).toEqual([undefined, 0]);
  });

  test("are not fetched while they are off or but one layer is played, and come when they are wanted again", async () => {
    rig.begin(textured(2, 2), FAST);
    rig.player.textures = false;
    void rig.player.load();
    await pass(1);
    expect(rig.workers.begun.every(({ job }) => !job.textured && job.companions.length === 0)).toBe(true);
    expect([frameOf(rig.viewer.shown), rig.player.stats.textures]).toEqual([undefined, "off"]);
    rig.player.textures = true;
    await pass(1);
    expect([frameOf(rig.viewer.shown), rig.player.stats.textures]).toEqual([0, "shown"]);
    rig.player.layers = 0;
    await pass(1);
    expect([frameOf(rig.viewer.shown), rig.player.stats.textures]).toEqual([undefined, "left out"]);
  });
});
