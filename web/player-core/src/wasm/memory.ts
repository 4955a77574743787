// The core's wasm instance and its memory. Arrays are copied in, results out: what JavaScript holds outlives the instance.

import { FormatError } from "../errors.ts";
import type { Mesh } from "../mesh.ts";

type Call = (...values: (number | bigint)[]) => number | bigint | undefined;

const NO_MEMORY = 4; // mr_status, core/include/meshreel/status.h

/** Representation of one argument or field of a struct in C++. */
type Scalar = readonly ["u32" | "i32" | "f64", number];
export type Bytes = Uint8Array | Int32Array | Float64Array | BigInt64Array;

/** The core ran out of memory or trapped: its instance cannot be used again. */
export class CoreStopped extends Error {
  override name = "CoreStopped";
}

/** One instance of the compiled core. */
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

  /** Calls an exported function and returns its result, 0 for none. Throws CoreStopped where it traps. */
  call(name: string, ...values: (number | bigint)[]): number {
    try {
      return Number(this.calls[name](...values) ?? 0);
    } catch (error) {
      throw error instanceof WebAssembly.RuntimeError ? new CoreStopped(`${name}: ${error.message}`) : error;
    }
  }

  /** Throws FormatError with `what` and the core's message where a call's status is not 0; CoreStopped where memory ran out. */
  check(status: number, what = ""): void {
    if (status === 0) return;
    const text = new Uint8Array(this.buffer, this.call("mr_message", status));
    const message = what + new TextDecoder().decode(text.slice(0, text.indexOf(0)));
    throw status === NO_MEMORY ? new CoreStopped(message) : new FormatError(message);
  }

  /** Returns what `body` returns; the memory that `body` took is free again afterwards. */
  run<T>(body: (arena: Arena) => T): T {
    const arena = new Arena(this);
    try {
      return body(arena);
    } finally {
      arena.release();
    }
  }

  /** The memory as it is now. It moves when it grows: do not keep this. */
  get buffer(): ArrayBuffer {
    return this.memory.buffer;
  }
}

/** Memory of the core for the length of a call. */
export class Arena {
  private readonly taken: number[] = [];

  constructor(readonly core: Core) {}

  /** Room for `size` bytes, aligned for every type. Throws CoreStopped where there is none. */
  room(size: number): number {
    const place = this.core.call("mr_allocate", Math.max(size, 1));
    if (place === 0) throw new CoreStopped(`no memory for ${size} bytes`);
    this.taken.push(place);
    return place;
  }

  /** The bytes of an array, copied. */
  put(values: Bytes): number {
    const place = this.room(values.byteLength);
    const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    new Uint8Array(this.core.buffer, place, bytes.length).set(bytes);
    return place;
  }

  /** A struct of these fields, each aligned to its size. */
  struct(...fields: Scalar[]): number {
    const size = fields.reduce((sum, [kind]) => aligned(sum, kind) + sizeOf(kind), 0);
    const place = this.room(size);
    const view = new DataView(this.core.buffer, place, size);
    let offset = 0;
    for (const [kind, value] of fields) {
      offset = aligned(offset, kind);
      if (kind === "f64") view.setFloat64(offset, value, true);
      else view.setUint32(offset, value >>> 0, true);
      offset += sizeOf(kind);
    }
    return place;
  }

  /** A struct mr_bytes around a copy of bytes. */
  record(bytes: Uint8Array): number {
    return this.struct(["u32", this.put(bytes)], ["u32", bytes.length]);
  }

  /** A struct mr_mesh around copies of a mesh's arrays. */
  mesh({ vertices, faces }: Mesh): number {
    const [positions, corners] = [this.put(vertices), this.put(faces)];
    return this.struct(["u32", positions], ["u32", vertices.length / 3], ["u32", corners], ["u32", faces.length / 3]);
  }

  /** Copies of what lies at a place. */
  bytes(place: number, count: number): Uint8Array {
    return new Uint8Array(this.core.buffer, place, count).slice();
  }

  u16(place: number, count: number): Uint16Array {
    return new Uint16Array(this.core.buffer, place, count).slice();
  }

  u32(place: number): number {
    return new DataView(this.core.buffer).getUint32(place, true);
  }

  i32(place: number, count: number): Int32Array {
    return new Int32Array(this.core.buffer, place, count).slice();
  }

  i64(place: number, count: number): BigInt64Array {
    return new BigInt64Array(this.core.buffer, place, count).slice();
  }

  f64(place: number, count: number): Float64Array {
    return new Float64Array(this.core.buffer, place, count).slice();
  }

  release(): void {
    // A core that has stopped has no memory to give back to.
    for (const place of this.taken.splice(0)) {
      try {
        this.core.call("mr_release", place);
      } catch {
        return;
      }
    }
  }
}

function sizeOf(kind: Scalar[0]): number {
  return kind === "f64" ? 8 : 4;
}

function aligned(offset: number, kind: Scalar[0]): number {
  return Math.ceil(offset / sizeOf(kind)) * sizeOf(kind);
}
