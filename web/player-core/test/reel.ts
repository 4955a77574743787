// Files made of noise: an index as told, and payloads that nothing but a stand-in for a worker can decode.

import { crc32 } from "../src/format/crc.ts";
import { AudioType, ChunkKind, Form } from "../src/format/layout.gen.ts";
import { noise } from "./server.ts";

const KINDS = { static: ChunkKind.STATIC, group: ChunkKind.GROUP, colors: ChunkKind.COLORS, atlas: ChunkKind.ATLAS, pictures: ChunkKind.PICTURES, compatible: ChunkKind.COMPATIBLE, splats: ChunkKind.SPLATS, audio: ChunkKind.AUDIO, future: 200 };

export interface FakeChunk {
  readonly kind: keyof typeof KINDS;
  readonly form: number;
  readonly frames: number;
  readonly track: number;
  readonly dependsOn: readonly number[];
  readonly layers: readonly number[]; // bytes of each
  readonly body?: Uint8Array; // in place of noise
}

export interface FakeHeader {
  readonly frameRate: number;
  readonly intervals?: readonly number[]; // microseconds
  readonly metadata?: string;
}

export function group(frames: number, layers: readonly number[], more: Partial<FakeChunk> = {}): FakeChunk {
  return { kind: "group", form: Form.LAYERS, frames, track: 0, dependsOn: [], layers, ...more };
}

/** Colours of a group of ten frames, or of what `more` says; `dependsOn`: that chunk, then the colours that they are predicted from. */
export function colors(dependsOn: readonly number[], layers: readonly number[], more: Partial<FakeChunk> = {}): FakeChunk {
  return { kind: "colors", form: Form.VERTEX_COLORS, frames: 10, track: 0, dependsOn, layers, ...more };
}

/** An audio file of so many bytes, of Opus in Ogg, that begins `start` seconds after the first frame. */
export function audio(bytes: number, start = 0, more: Partial<FakeChunk> = {}): FakeChunk {
  const body = noise(bytes + 10, 3);
  body[1] = AudioType.OGG;
  new DataView(body.buffer).setBigInt64(2, BigInt(Math.round(1e6 * start)), true);
  return { kind: "audio", form: Form.AUDIO_FILE, frames: 0, track: 0, dependsOn: [], layers: [body.length], body, ...more };
}

export function background(bytes: number, dependsOn: readonly number[] = []): FakeChunk {
  return { kind: "static", form: dependsOn.length > 0 ? Form.PATCH : Form.DRACO, frames: 0, track: 0, dependsOn, layers: [bytes] };
}

/** One track of groups of ten frames, chained in runs of `chain`, at 25 frames a second. Rates are bytes a second of its layers. */
export function stream(seconds: number, rates: readonly number[], chain = 1, frameRate = 25): Uint8Array<ArrayBuffer> {
  const groups = Math.round((seconds * frameRate) / 10);
  const layers = rates.map((rate) => Math.round((rate * 10) / frameRate));
  const chunks = Array.from({ length: groups }, (_, k) => group(10, layers, { dependsOn: k % chain === 0 ? [] : [k - 1] }));
  return makeReel(chunks, { frameRate });
}

export function makeReel(chunks: readonly FakeChunk[], { frameRate, intervals = [], metadata = "{}" }: FakeHeader): Uint8Array<ArrayBuffer> {
  const bodies = chunks.map(({ form, layers, body: given }, k) => {
    const body = given ?? noise(layers.reduce((sum, size) => sum + size, 0), 7 + k);
    body[0] = form;
    return body;
  });
  const index = new Writer().u32(chunks.length);
  chunks.forEach((chunk, k) => {
    index.u8(KINDS[chunk.kind]).u8(chunk.form).u16(chunk.frames).varint(chunk.track).u8(chunk.dependsOn.length);
    for (const number of chunk.dependsOn) index.varint(number);
    index.u16(chunk.layers.length);
    let at = 0;
    for (const size of chunk.layers) index.varint(size).u32(crc32(bodies[k].subarray(at, (at += size))));
  });
  const header = new Writer().f64(frameRate).f64(0).f64(0).f64(0).f64(1);
  for (const corner of [-0.5, -0.5, -0.5, 0.5, 0.5, 0.5]) header.f32(corner);
  const text = new TextEncoder().encode(metadata);
  header.u16(text.length);
  for (const byte of text) header.u8(byte);
  header.u32(0).u32(0).varint(intervals.length);
  for (const interval of intervals) header.varint(interval);
  const size = 14 + header.bytes.length + index.bytes.length + 4;
  const head = new Writer(82, 69, 69, 76, 13, 10, 26, 10).u8(1).u8(0).u32(size);
  for (const byte of [...header.bytes, ...index.bytes]) head.u8(byte);
  head.u32(crc32(Uint8Array.from(head.bytes)));
  const file = new Uint8Array(size + bodies.reduce((sum, body) => sum + body.length, 0));
  file.set(head.bytes);
  let at = size;
  for (const body of bodies) {
    file.set(body, at);
    at += body.length;
  }
  return file;
}

class Writer {
  readonly bytes: number[];

  constructor(...bytes: number[]) {
    this.bytes = bytes;
  }

  u8(value: number): this {
    this.bytes.push(value);
    return this;
  }

  u16(value: number): this {
    return this.u8(value & 255).u8(value >> 8);
  }

  u32(value: number): this {
    return this.u16(value & 65535).u16(value >>> 16);
  }

  f32(value: number): this {
    this.bytes.push(...new Uint8Array(Float32Array.of(value).buffer));
    return this;
  }

  f64(value: number): this {
    this.bytes.push(...new Uint8Array(Float64Array.of(value).buffer));
    return this;
  }

  varint(value: number): this {
    for (; value > 127; value = Math.floor(value / 128)) this.u8((value % 128) | 128);
    return this.u8(value);
  }
}
