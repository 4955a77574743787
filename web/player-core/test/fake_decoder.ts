// A stand-in for the browser's video decoder, which Node has not, and packets that nothing else decodes.

import { afterEach, beforeEach, expect, vi } from "vitest";

import { Form } from "../src/format/layout.gen.ts";
import type { TextureImage } from "../src/types.ts";
import type { Rig } from "./rig.ts";

export const [WIDTH, HEIGHT] = [64, 32]; // of what the stand-ins for workers tell

interface Packet {
  readonly type: string;
  readonly timestamp: number;
  readonly data: Uint8Array;
}

/** A packet that no decoder but the stand-in knows; to AV1 it is an OBU of padding. */
export function fakePacket(number: number, damage = 0): number[] {
  return [15 << 3, number, damage];
}

/** Decodes a packet in the time it is told; knows its own laws, and the frames that are open. */
export class FakeDecoder {
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

/** Puts the stand-in in the place of WebCodecs in each test; all pictures must be closed behind it. */
export function useFakeDecoder(rig: Rig): void {
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
}

/** A record of pictures. */
export function video(codec: number, interval: number, packets: readonly number[][]): Uint8Array {
  return Uint8Array.of(Form.VIDEO, codec, interval, packets.length, 0, ...packets.flatMap((packet) => [...(packet.length > 127 ? [(packet.length & 127) | 128] : []), packet.length > 127 ? packet.length >> 7 : packet.length, ...packet]));
}
