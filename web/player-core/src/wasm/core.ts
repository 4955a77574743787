// The compiled decoder (core/wasm/player.h) and its memory. Bytes are copied in, results out: what JavaScript holds outlives the instance.

import { FormatError } from "../errors.ts";
import { ChunkKind } from "../format/layout.gen.ts";

type Call = (...values: number[]) => number;

/** The decoder ran out of memory or trapped: its instance cannot be used again. */
export class CoreStopped extends Error {
  override name = "CoreStopped";
}

/** A chunk that was opened: its place in the memory of its core. */
export type Handle = number;

/** What a chunk is decoded from. */
export interface Opening {
  readonly payload: Uint8Array;
  readonly frames: number | null; // of a group; null: a state of the background
  readonly layers: number | null; // beyond the first, at most; null: all
  readonly previous: Handle | null; // that it is predicted or changed from
  readonly isShown: boolean; // else only what the next is predicted from is decoded
  readonly scale: number; // m, of a coordinate
  readonly origin: readonly number[]; // m
}

/** A chunk as the GPU takes it; what types.ts says of PackedGroup and PackedStatic. */
export interface PackedArrays {
  readonly bounds: Float64Array; // three lower, then three upper
  readonly unit: number;
  readonly vertexCount: number;
  readonly rows: number;
  readonly splatCount: number;
  readonly width: number; // of the texture; 0 where there are no places
  readonly height: number;
  readonly texels: Uint16Array;
  readonly colors: Uint8Array;
  readonly faces: Uint32Array;
  readonly extra: Uint32Array;
  readonly extraStarts: Uint32Array;
  readonly places: Uint16Array;
  readonly extraPlaces: Uint16Array;
  readonly words: Uint32Array; // of splats
}

/** A frame as it was decoded, in the order of `mr_shown`. */
export interface ShownFrame {
  readonly vertices: Float64Array;
  readonly faces: Int32Array;
  readonly colors: Uint8Array;
  readonly splats: readonly Float64Array[]; // means, axes, scales, opacities and colours
}

type Numbers = typeof Uint8Array | typeof Uint16Array | typeof Int32Array | typeof Uint32Array | typeof Float64Array;

const COMPANIONS = { colors: ChunkKind.COLORS, atlas: ChunkKind.ATLAS, splats: ChunkKind.SPLATS } as const;

/** One instance of the compiled decoder. */
export class Core {
  private readonly calls: Record<string, Call>;
  private readonly memory: WebAssembly.Memory;

  private constructor(instance: WebAssembly.Instance) {
    this.calls = instance.exports as unknown as Record<string, Call>;
    this.memory = instance.exports["memory"] as WebAssembly.Memory;
  }

  static async create(module: WebAssembly.Module): Promise<Core> {
    // The standard library would write why it stops, but there is nowhere to write to; the trap reports that it stopped.
    const wasi = { fd_close: () => 0, fd_seek: () => 0, fd_write: () => 0 };
    const core = new Core(await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi }));
    core.calls["_initialize"]?.();
    return core;
  }

  /** Bytes of memory that the instance has taken. */
  get size(): number {
    return this.memory.buffer.byteLength;
  }

  /** Decodes a chunk, which stays until it is closed. FormatError where its bytes are refused. */
  open({ payload, frames, layers, previous, isShown, scale, origin }: Opening): Handle {
    const [chunk, place] = [28, 32]; // bytes of mr_chunk and mr_placement
    return this.with(payload, chunk + place, (data, at) => {
      new Float64Array(this.memory.buffer, at, 4).set([scale, ...origin]);
      new Int32Array(this.memory.buffer, at + place, 7).set([data, payload.length, frames ?? -1, layers ?? -1, previous ?? 0, isShown ? 1 : 0, at]);
      return this.found(this.call("mr_open_chunk", at + place));
    });
  }

  /** Decodes a companion of a chunk. FormatError where it is refused; the chunk is as before then. */
  dress(chunk: Handle, kind: keyof typeof COMPANIONS, payload: Uint8Array): void {
    this.with(payload, 0, (data) => this.found(this.call("mr_dress_chunk", chunk, COMPANIONS[kind], data, payload.length) === 0 ? 1 : 0));
  }

  /** A chunk as the GPU takes it. FormatError where it has more than can be shown. */
  pack(chunk: Handle, isTextured: boolean): PackedArrays {
    const at = this.found(this.call("mr_pack_chunk", chunk, isTextured ? 1 : 0));
    const bounds = new Float64Array(this.memory.buffer, at, 7).slice();
    const [vertexCount, rows, splatCount, width, height] = new Uint32Array(this.memory.buffer, at + 56, 5);
    const array = <T extends Numbers>(of: T, number: number): InstanceType<T> => this.array(of, at + 76 + 8 * number);
    return {
      ...{ bounds: bounds.subarray(0, 6), unit: bounds[6], vertexCount, rows, splatCount, width, height },
      ...{ texels: array(Uint16Array, 0), colors: array(Uint8Array, 1), faces: array(Uint32Array, 2), extra: array(Uint32Array, 3) },
      ...{ extraStarts: array(Uint32Array, 4), places: array(Uint16Array, 5), extraPlaces: array(Uint16Array, 6), words: array(Uint32Array, 7) },
    };
  }

  /** A frame of a chunk as it was decoded, in metres. */
  show(chunk: Handle, frame: number): ShownFrame {
    const at = this.found(this.call("mr_show_frame", chunk, frame));
    const splats = [3, 4, 5, 6, 7].map((number) => this.array(Float64Array, at + 8 * number));
    return { vertices: this.array(Float64Array, at), faces: this.array(Int32Array, at + 8), colors: this.array(Uint8Array, at + 16), splats };
  }

  /** Frees all of a chunk but what the next is predicted or changed from. */
  trim(chunk: Handle): void {
    this.call("mr_trim_chunk", chunk);
  }

  close(chunk: Handle): void {
    this.call("mr_close_chunk", chunk);
  }

  /** Calls with a copy of bytes and room behind it, which are free again afterwards. */
  private with<T>(bytes: Uint8Array, room: number, body: (data: number, room: number) => T): T {
    const start = this.call("mr_allocate", bytes.length + room + 8);
    if (start === 0) throw new CoreStopped(`no memory for ${bytes.length} bytes`);
    const data = start + room;
    new Uint8Array(this.memory.buffer, data, bytes.length).set(bytes);
    try {
      return body(data, start);
    } finally {
      if (!this.isStopped) this.call("mr_release", start);
    }
  }

  private isStopped = false;

  private call(name: string, ...values: number[]): number {
    try {
      return this.calls[name](...values);
    } catch (error) {
      this.isStopped = true;
      throw new CoreStopped(`${name}: ${error instanceof Error ? error.message : String(error)}`);
    }
  }

  /** What a call gives. FormatError with the decoder's words where it refused; CoreStopped where memory ran out. */
  private found(result: number): number {
    if (result !== 0) return result;
    const text = new Uint8Array(this.memory.buffer, this.call("mr_refusal"));
    const message = new TextDecoder().decode(text.slice(0, text.indexOf(0)));
    throw message === "" ? new CoreStopped("no memory") : new FormatError(message);
  }

  /** A copy of the numbers of a struct mr_array. */
  private array<T extends Numbers>(of: T, at: number): InstanceType<T> {
    const [start, size] = new Uint32Array(this.memory.buffer, at, 2);
    return new of(new Uint8Array(this.memory.buffer, start, size).slice().buffer) as InstanceType<T>;
  }
}
