// Textures as Python writes them: places of corners in an atlas, and what packets say of their video.

import { describe, expect, test, vi } from "vitest";

import { hasPython, runPython } from "../../test/python.ts";
import { ChunkDecoder } from "../src/decode/chunk_decoder.ts";
import { texelsOf } from "../src/format/renditions.ts";
import { headersOf } from "../src/format/video_headers.ts";
import { FormatError } from "../src/errors.ts";
import { Atlas, Form, Pictures } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import { unpackAll } from "../src/format/records.ts";
import { NO_PLACE, PLACE_SCALE } from "../src/types.ts";
import type { PackedGroup, Rendition } from "../src/types.ts";
import { FakeDecoder, useFakeDecoder, video } from "./fake_decoder.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { colors, group, makeReel } from "./reel.ts";
import { pass, useRig } from "./rig.ts";
import { nodeCore } from "./tools.ts";
import type { Handle } from "../src/wasm/core.ts";

interface Made {
  readonly file: string;
  readonly all: readonly string[];
  readonly oneLayer: readonly string[];
  readonly large: Readonly<Record<Rendition, string>>;
}

const made = hasPython ? (JSON.parse(runPython(new URL("textured.py", import.meta.url), 8, 4).toString()) as Made) : null;
const bytesIn = (text: string): Uint8Array => Uint8Array.from(Buffer.from(text, "base64"));

describe.skipIf(!hasPython)("an atlas", async () => {
  const core = await nodeCore();
  const data = bytesIn(made?.file ?? "");
  const head = Head.parse(data);
  const atlas = head.chunks.find(({ kind }) => kind === "atlas")!;
  const bytesOf = ({ offset, size }: { offset: number; size: number }): Uint8Array => data.slice(offset, offset + size);
  const { width, height } = unpackAll(Atlas, bytesOf(atlas));
  const open = (layers: number | null): Handle => {
    const chunk = head.chunks[atlas.dependsOn[0]];
    return core.open({ payload: bytesOf(chunk), frames: chunk.frameCount, layers, previous: null, isShown: true, scale: 1, origin: [0, 0, 0] });
  };

  test("is packed with its group and those predicted from it, and only where pictures are shown", () => {
    const decoder = new ChunkDecoder(core);
    for (const chunk of head.tracks[0]) {
      const job = jobOf(head, chunk, data);
      expect((decoder.decode({ ...job, textured: false, payload: job.payload.slice() }, noDamage) as PackedGroup).places).toBeNull();
      const packed = decoder.decode(job, noDamage) as PackedGroup;
      expect(packed.places).toMatchObject({ width, height });
      expect(packed.places!.faces.length).toBe(2 * packed.faces.length);
      expect(packed.places!.extra.length).toBe(2 * packed.extra.length);
      expect(packed.places!.faces.every((place) => place <= PLACE_SCALE || place === NO_PLACE)).toBe(true);
    }
  });

  test("that is damaged or of another mesh is refused, never more", () => {
    const [payload, chunk] = [bytesOf(atlas), open(null)];
    for (let at = 0; at < payload.length; at++) {
      const copy = payload.slice();
      copy[at] ^= 1 << at % 8;
      try {
        core.dress(chunk, "atlas", copy);
        expect(core.pack(chunk, true).places.every((place) => place <= PLACE_SCALE || place === NO_PLACE)).toBe(true);
      } catch (error) {
        expect(error).toBeInstanceOf(FormatError);
      }
    }
    expect(() => core.dress(chunk, "atlas", Uint8Array.of(Form.PLACES, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0))).toThrow(/side is odd/);
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
    expect(texelsOf(kind, first())).toBe(header.width * header.height);
    expect([header.width, header.height]).toEqual(kind === "pictures" ? [width, height] : [16 * Math.ceil(width / 16), 16 * Math.ceil(height / 16)]);
  });

  test("of pictures that are larger than a texture may be are refused", () => {
    expect(() => texelsOf(kind, bytesIn(made!.large[kind]))).toThrow(/2064 x 64, over 2048/);
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

describe.skipIf(!hasPython)("packets", () => {
  const rig = useRig();
  useFakeDecoder(rig);

  test("that say they are larger than a texture may be are given to no decoder", async () => {
    const packets = Array.from({ length: 10 }, () => [...bytesIn(made!.large.pictures)]);
    const body = video(1, 1, packets);
    const chunks = [group(10, [400]), colors([0], [20], { kind: "atlas", form: Form.PLACES }), colors([0, 1], [body.length], { kind: "pictures", form: Form.VIDEO, body })];
    const configured = vi.spyOn(FakeDecoder.prototype, "configure");
    rig.begin(makeReel(chunks, { frameRate: 25 }), 1e6);
    await Promise.all([rig.player.play(), pass(2)]);
    expect([rig.viewer.frames.at(-1), rig.player.stats.textures, configured.mock.calls]).toEqual([10 - 1, "damaged", []]);
    expect(rig.viewer.warnings).toEqual([expect.stringMatching(/^chunk 2 .*a picture of 2064 x 64, over 2048/)]);
    vi.restoreAllMocks();
  });
});
