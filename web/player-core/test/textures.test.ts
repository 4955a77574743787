// Textures: places of corners as in Python, and pictures in step with frames. A stand-in decodes: Node has no WebCodecs.

import { createHash } from "node:crypto";

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { hasPython, runPython } from "../../test/python.ts";
import { decodeAtlas, finerPlaces } from "../src/decode/atlas.ts";
import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import { readLayers } from "../src/decode/layers.ts";
import { decodeMesh } from "../src/decode/mesh.ts";
import { FormatError } from "../src/errors.ts";
import { checkSize } from "../src/decode/renditions.ts";
import { headersOf } from "../src/decode/video_headers.ts";
import { Atlas, Form, Pictures } from "../src/format/layout.gen.ts";
import { unpackAll } from "../src/format/records.ts";
import { Head } from "../src/format/reader.ts";
import { Fetcher } from "../src/net/fetcher.ts";
import { NO_PLACE, PLACE_SCALE } from "../src/types.ts";
import type { PackedGroup, Rendition, Shown, TextureImage } from "../src/types.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { background, colors, group, makeReel } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";
import { pass, useRig } from "./rig.ts";
import { nodeTools } from "./tools.ts";

const FAST = 1e6;
const FRAMES = 10; // of a group
const LAYERS = [400, 800];
const WIDTH = 64; // of what the stand-ins for workers tell
const HEIGHT = 32;

interface Made {
  readonly file: string;
  readonly all: readonly string[];
  readonly oneLayer: readonly string[];
  readonly large: Readonly<Record<Rendition, string>>;
}

const made = hasPython ? (JSON.parse(runPython(new URL("textured.py", import.meta.url), 8, 4).toString()) as Made) : null;
const bytesIn = (text: string): Uint8Array => Uint8Array.from(Buffer.from(text, "base64"));

describe.skipIf(!hasPython)("an atlas", async () => {
  const tools = await nodeTools();
  const data = bytesIn(made?.file ?? "");
  const head = Head.parse(data);
  const atlas = head.chunks.find(({ kind }) => kind === "atlas")!;
  const bytesOf = ({ offset, size }: { offset: number; size: number }): Uint8Array => data.slice(offset, offset + size);
  const { head: first } = readLayers(bytesOf(head.chunks[atlas.dependsOn[0]]), 0);
  const base = decodeMesh(tools.core, tools.draco, first.base, first.step);

  test.each([[1, "oneLayer"], [first.levels, "all"]] as const)("has the places that Python decodes, on level %i", (levels, name) => {
    const layout = decodeAtlas(tools.core, bytesOf(atlas), base);
    const uv = finerPlaces(layout, levels).map((place, k) => (k % 2 === 0 ? place / layout.width : 1 - place / layout.height));
    expect(createHash("sha256").update(new Uint8Array(uv.buffer)).digest("hex")).toBe(made![name][0]);
  });

  test("is packed with its group and those predicted from it, and only where pictures are shown", () => {
    const decoder = new ChunkDecoder(tools);
    const { width, height, places } = decodeAtlas(tools.core, bytesOf(atlas), base);
    for (const chunk of head.tracks[0]) {
      const job = jobOf(head, chunk, data);
      expect((decoder.decode({ ...job, textured: false, payload: job.payload.slice() }, noDamage) as PackedGroup).places).toBeNull();
      const packed = decoder.decode(job, noDamage) as PackedGroup;
      expect(packed.places).toMatchObject({ width, height });
      expect(packed.places!.faces.length).toBe(2 * packed.faces.length);
      expect(packed.places!.extra.length).toBe(2 * packed.extra.length);
      expect(packed.places!.faces.every((place) => place <= PLACE_SCALE || place === NO_PLACE)).toBe(true);
    }
    expect(places.length).toBe(2 * base.faces.length);
  });

  test("that is damaged or of another mesh is refused, never more", () => {
    const payload = bytesOf(atlas);
    for (let at = 0; at < payload.length; at++) {
      const copy = payload.slice();
      copy[at] ^= 1 << at % 8;
      try {
        const { width, height, places } = decodeAtlas(tools.core, copy, base);
        expect(places.every((place, k) => place >= 0 && place <= (k % 2 === 0 ? width : height))).toBe(true);
      } catch (error) {
        expect(error).toBeInstanceOf(FormatError);
      }
    }
    expect(() => decodeAtlas(tools.core, payload, { ...base, faces: base.faces.slice(3) })).toThrow(FormatError);
    expect(() => decodeAtlas(tools.core, Uint8Array.of(Form.PLACES, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0), base)).toThrow(/1 x 2 texels/);
  });
});

describe.skipIf(!hasPython).each(["pictures", "compatible"] as const)("the headers of a video (%s)", (kind) => {
  const data = bytesIn(made?.file ?? "");
  const first = (): Uint8Array => {
    const { offset, size } = Head.parse(data).chunks.find((chunk) => chunk.kind === kind)!;
    return unpackAll(Pictures, data.slice(offset, offset + size)).packets[0];
  };

  test("tell codec and size, in the first packet alone", () => {
    const [header, ...others] = headersOf(kind, first());
    expect(others).toEqual([]);
    expect(header.codec).toMatch(kind === "pictures" ? /^av01\.0\.\d\dM\.08$/ : /^avc1\.[0-9a-f]{6}$/);
    const { offset, size } = Head.parse(data).chunks.find((chunk) => chunk.kind === "atlas")!;
    const { width, height } = unpackAll(Atlas, data.slice(offset, offset + size));
    expect([header.width, header.height]).toEqual(kind === "pictures" ? [width, height] : [16 * Math.ceil(width / 16), 16 * Math.ceil(height / 16)]);
    expect(() => checkSize(kind, first())).not.toThrow();
  });

  test("of pictures that are larger than a texture may be are refused", () => {
    expect(() => checkSize(kind, bytesIn(made!.large[kind]))).toThrow(/2064 x 64, over 2048/);
  });

  test("that are damaged or break off are read or refused in words", () => {
    const packet = first().subarray(0, 80);
    const attempt = (bytes: Uint8Array): void => {
      try {
        headersOf(kind, bytes);
      } catch (error) {
        expect(error).toBeInstanceOf(FormatError);
      }
    };
    for (let at = 0; at < packet.length; at++) {
      attempt(packet.subarray(0, at));
      for (let bit = 0; bit < 8; bit++) attempt(packet.map((byte, k) => (k === at ? byte ^ (1 << bit) : byte)));
    }
  });
});

interface Packet {
  readonly type: string;
  readonly timestamp: number;
  readonly data: Uint8Array;
}

/** A packet that no decoder but the stand-in knows; to AV1 it is an OBU of padding. */
function fakePacket(number: number, damage = 0): number[] {
  return [15 << 3, number, damage];
}

/** Decodes a packet in the time it is told; knows its own laws, and the frames that are open. */
class FakeDecoder {
  static open = new Set<TextureImage & { readonly frame: number; readonly codec: string }>();
  static most = 0;
  static decoded: number[] = []; // numbers of packets, which are those of frames
  static ms = 5;
  static height = HEIGHT;
  static isConfigSupported = async ({ codec }: VideoDecoderConfig): Promise<{ supported: boolean }> => ({ supported: FakeDecoder.supported.test(codec) });
  static supported = /./; // codecs
  static msOf = (_codec: string): number => FakeDecoder.ms;
  state = "unconfigured";
  private codec = "";
  private hasKey = false;
  private last = Promise.resolve();

  constructor(private readonly init: { output(image: unknown): void; error(error: Error): void }) {}

  configure({ codec, avc }: VideoDecoderConfig & { readonly avc?: unknown }): void {
    expect(avc).toEqual(codec.startsWith("avc1.") ? { format: "annexb" } : undefined);
    this.codec = codec;
    this.state = "configured";
  }

  decode({ type, timestamp, data }: Packet): void {
    if (!this.hasKey && type !== "key") throw new TypeError("a key is needed");
    this.hasKey = true;
    const [, frame, isDamaged] = data;
    this.last = this.last.then(() => new Promise((done) => setTimeout(done, FakeDecoder.msOf(this.codec)))).then(() => {
      if (this.state === "closed") return;
      if (isDamaged) {
        this.state = "closed";
        return this.init.error(new Error("decoding failed"));
      }
      FakeDecoder.decoded.push(frame);
      const image = { frame, codec: this.codec, timestamp, displayWidth: WIDTH, displayHeight: FakeDecoder.height, close: () => void FakeDecoder.open.delete(image) };
      FakeDecoder.open.add(image);
      FakeDecoder.most = Math.max(FakeDecoder.most, FakeDecoder.open.size);
      this.init.output(image);
    });
  }

  close(): void {
    this.state = "closed";
  }
}

describe("pictures", () => {
  const rig = useRig();
  beforeEach(() => {
    Object.assign(FakeDecoder, { open: new Set(), most: 0, decoded: [], ms: 5, msOf: () => FakeDecoder.ms, height: HEIGHT, supported: /./ });
    vi.stubGlobal("VideoDecoder", FakeDecoder);
    vi.stubGlobal("EncodedVideoChunk", class { constructor(init: Packet) { Object.assign(this, init); } });
  });
  afterEach(() => {
    rig.player.dispose();
    expect(FakeDecoder.open.size).toBe(0);
    vi.unstubAllGlobals();
  });

  /** A record of pictures. */
  function video(codec: number, interval: number, packets: readonly number[][]): Uint8Array {
    return Uint8Array.of(Form.VIDEO, codec, interval, packets.length, 0, ...packets.flatMap((packet) => [...(packet.length > 127 ? [(packet.length & 127) | 128] : []), packet.length > 127 ? packet.length >> 7 : packet.length, ...packet]));
  }

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

  test.skipIf(!hasPython)("that say they are larger than a texture may be are given to no decoder", async () => {
    const packets = Array.from({ length: FRAMES }, () => [...bytesIn(made!.large.pictures)]);
    const body = video(1, 1, packets);
    const chunks = [group(FRAMES, LAYERS), colors([0], [20], { kind: "atlas", form: Form.PLACES }), colors([0, 1], [body.length], { kind: "pictures", form: Form.VIDEO, body })];
    const configured = vi.spyOn(FakeDecoder.prototype, "configure");
    rig.begin(makeReel(chunks, { frameRate: 25 }), FAST);
    await Promise.all([rig.player.play(), pass(2)]);
    expect([rig.viewer.frames.at(-1), rig.player.stats.textures, configured.mock.calls]).toEqual([FRAMES - 1, "damaged", []]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk 2 .*a picture of 2064 x 64, over 2048/)]);
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

  test("of a background go on slowly, from layer to layer, and stay behind the last", async () => {
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

  test("of a background are fetched by the layer that is shown", async () => {
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

  test("of a background that are late hold up nobody: the one before stays, and the statistics say so", async () => {
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

  test("of a background that are damaged leave its vertices' colours, and playback goes on", async () => {
    rig.begin(slow(10), FAST);
    await Promise.all([rig.player.play(), pass(20)]);
    expect(rig.viewer.frames.at(-1)).toBe(449);
    expect([slowOf(), rig.player.stats.textures]).toEqual([undefined, "damaged"]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk 2 \(pictures, static\): a damaged picture/)]);
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
