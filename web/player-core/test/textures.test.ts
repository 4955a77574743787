// Textures: places of corners as in Python, and pictures in step with frames. A stand-in decodes: Node has no WebCodecs.

import { createHash } from "node:crypto";

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { hasPython, runPython } from "../../test/python.ts";
import { decodeAtlas, finerPlaces } from "../src/decode/atlas.ts";
import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import { readLayers } from "../src/decode/layers.ts";
import { decodeMesh } from "../src/decode/mesh.ts";
import { FormatError } from "../src/errors.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import { NO_PLACE, PLACE_SCALE } from "../src/types.ts";
import type { PackedGroup, Shown, TextureImage } from "../src/types.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { colors, group, makeReel } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";
import { pass, useRig } from "./rig.ts";
import { nodeTools } from "./tools.ts";

const FAST = 1e6;
const FRAMES = 10; // of a group
const LAYERS = [400, 800];
const WIDTH = 64; // of what the stand-ins for workers tell
const HEIGHT = 32;

describe.skipIf(!hasPython)("an atlas", async () => {
  const tools = await nodeTools();
  const made = hasPython ? (JSON.parse(runPython(new URL("textured.py", import.meta.url), 8, 4).toString()) as { file: string; all: string[]; oneLayer: string[] }) : null;
  const data = Uint8Array.from(Buffer.from(made?.file ?? "", "base64"));
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

interface Packet {
  readonly type: string;
  readonly timestamp: number;
  readonly data: Uint8Array;
}

/** Decodes a packet in the time it is told; knows its own laws, and the frames that are open. */
class FakeDecoder {
  static open = new Set<TextureImage & { readonly frame: number }>();
  static most = 0;
  static decoded: number[] = []; // first bytes of packets, which are the frames' numbers
  static ms = 5;
  static height = HEIGHT;
  static isConfigSupported = async (): Promise<{ supported: boolean }> => ({ supported: FakeDecoder.supported });
  static supported = true;
  state = "unconfigured";
  private hasKey = false;
  private last = Promise.resolve();

  constructor(private readonly init: { output(image: unknown): void; error(error: Error): void }) {}

  configure(): void {
    this.state = "configured";
  }

  decode({ type, timestamp, data }: Packet): void {
    if (!this.hasKey && type !== "key") throw new TypeError("a key is needed");
    this.hasKey = true;
    const [frame, isDamaged] = data;
    this.last = this.last.then(() => new Promise((done) => setTimeout(done, FakeDecoder.ms))).then(() => {
      if (this.state === "closed") return;
      if (isDamaged) {
        this.state = "closed";
        return this.init.error(new Error("decoding failed"));
      }
      FakeDecoder.decoded.push(frame);
      const image = { frame, timestamp, displayWidth: WIDTH, displayHeight: FakeDecoder.height, close: () => void FakeDecoder.open.delete(image) };
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
    Object.assign(FakeDecoder, { open: new Set(), most: 0, decoded: [], ms: 5, height: HEIGHT, supported: true });
    vi.stubGlobal("VideoDecoder", FakeDecoder);
    vi.stubGlobal("EncodedVideoChunk", class { constructor(init: Packet) { Object.assign(this, init); } });
  });
  afterEach(() => {
    rig.player.dispose();
    expect(FakeDecoder.open.size).toBe(0);
    vi.unstubAllGlobals();
  });

  /** Chains of `chain` groups with textures; the packet of a damaged frame says so. */
  function textured(groups: number, chain: number, damaged = -1): Uint8Array<ArrayBuffer> {
    const chunks: FakeChunk[] = [];
    let [before, atlas, pictures] = [-1, -1, -1];
    for (let k = 0; k < groups; k++) {
      const number = chunks.length;
      const isFirst = k % chain === 0;
      chunks.push(group(FRAMES, LAYERS, { dependsOn: isFirst ? [] : [before] }));
      if (isFirst) atlas = chunks.push(colors([number], [20], { kind: "atlas", form: Form.PLACES })) - 1;
      const packets = Array.from({ length: FRAMES }, (_, t) => [2, FRAMES * k + t, FRAMES * k + t === damaged ? 1 : 0]).flat();
      const body = Uint8Array.of(Form.VIDEO, 1, FRAMES, 0, ...packets);
      const dependsOn = isFirst ? [number, atlas] : [number, atlas, pictures];
      pictures = chunks.push(colors(dependsOn, [body.length], { kind: "pictures", form: Form.VIDEO, body })) - 1;
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
    rig.begin(textured(4, 2, 12), FAST);
    watch(20);
    await Promise.all([rig.player.play(), pass(3)]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk \d+ \(pictures, track 0, frames (0 to 9|10 to 19)\): a damaged picture/)]);
    expect(rig.viewer.frames.at(-1)).toBe(39);
  });

  test.each([
    ["unsupported", /decodes no AV1/, { supported: false }],
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
