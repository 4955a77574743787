// Records: how fields lie in bytes. In: bytes. Out: values, or a FormatError that names record and field.
// layout.gen.ts is made of these; reads beside src/meshreel/format/kinds.py.

import { FormatError } from "../errors.ts";

/** Position of a reader in bytes. */
export interface Cursor {
  readonly data: Uint8Array;
  readonly view: DataView;
  offset: number;
}

/** Reader of one kind of value; `least` is its smallest size in bytes. */
export interface Kind<T> {
  readonly least: number;
  read(cursor: Cursor): T;
}

/** Values of one kind that lie in the first bytes of `data` from `offset`, and the offset behind them. */
export function unpack<T>(kind: Kind<T>, data: Uint8Array, offset = 0): [T, number] {
  const cursor = { data, view: new DataView(data.buffer, data.byteOffset, data.byteLength), offset };
  return [kind.read(cursor), cursor.offset];
}

/** The value that fills `data` exactly. FormatError where bytes are left over. */
export function unpackAll<T>(kind: Kind<T>, data: Uint8Array): T {
  const [value, end] = unpack(kind, data);
  if (end !== data.length) throw new FormatError(`${data.length - end} bytes too many`);
  return value;
}

function take(cursor: Cursor, size: number): number {
  const start = cursor.offset;
  if (size > cursor.data.length - start) {
    throw new FormatError(`${size} bytes needed at byte ${start}, ${cursor.data.length - start} left`);
  }
  cursor.offset = start + size;
  return start;
}

function number(size: number, get: (view: DataView, offset: number) => number): Kind<number> {
  return { least: size, read: (cursor) => get(cursor.view, take(cursor, size)) };
}

function finite(value: number): number {
  if (!Number.isFinite(value)) throw new FormatError(`${value} is not finite`);
  return value;
}

function safe(value: bigint): number {
  const result = Number(value);
  if (!Number.isSafeInteger(result)) throw new FormatError(`${value} is beyond 53 bits`);
  return result;
}

export const u8 = number(1, (view, offset) => view.getUint8(offset));
export const u16 = number(2, (view, offset) => view.getUint16(offset, true));
export const u32 = number(4, (view, offset) => view.getUint32(offset, true));
export const i64 = number(8, (view, offset) => safe(view.getBigInt64(offset, true)));
export const f32 = number(4, (view, offset) => finite(view.getFloat32(offset, true)));
export const f64 = number(8, (view, offset) => finite(view.getFloat64(offset, true)));

/** LEB128, never longer than needed; beyond 53 bits nothing in a file that can be played is. */
export const varint: Kind<number> = {
  least: 1,
  read(cursor) {
    let value = 0;
    let scale = 1;
    for (let count = 0; ; count++) {
      const byte = cursor.view.getUint8(take(cursor, 1));
      value += (byte & 0x7f) * scale;
      if (byte < 0x80) {
        if (count > 0 && byte === 0) throw new FormatError("a varint longer than it needs to be");
        break;
      }
      if (count === 8) throw new FormatError("a varint beyond 53 bits");
      scale *= 128;
    }
    if (!Number.isSafeInteger(value)) throw new FormatError("a varint beyond 53 bits");
    return value;
  },
};

export function choice(kind: Kind<number>, values: Readonly<Record<string, number>>): Kind<number> {
  const known = new Set(Object.values(values));
  return {
    least: kind.least,
    read(cursor) {
      const value = kind.read(cursor);
      if (!known.has(value)) throw new FormatError(`${value} is none of the known values`);
      return value;
    },
  };
}

/** Views of the bytes, not copies. */
export function bytes(size: number): Kind<Uint8Array> {
  return { least: size, read: (cursor) => part(cursor, size) };
}

export function blob(length: Kind<number>): Kind<Uint8Array> {
  return { least: length.least, read: (cursor) => part(cursor, length.read(cursor)) };
}

export const rest: Kind<Uint8Array> = { least: 0, read: (cursor) => part(cursor, cursor.data.length - cursor.offset) };

function part(cursor: Cursor, size: number): Uint8Array {
  const start = take(cursor, size);
  return cursor.data.subarray(start, start + size);
}

export function text(length: Kind<number>): Kind<string> {
  const raw = blob(length);
  return {
    least: length.least,
    read(cursor) {
      try {
        return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(raw.read(cursor));
      } catch (error) {
        throw error instanceof FormatError ? error : new FormatError("not UTF-8");
      }
    },
  };
}

export function array<T>(count: number, item: Kind<T>): Kind<readonly T[]> {
  return { least: count * item.least, read: (cursor) => items(cursor, count, item) };
}

export function list<T>(length: Kind<number>, item: Kind<T>): Kind<readonly T[]> {
  return { least: length.least, read: (cursor) => items(cursor, length.read(cursor), item) };
}

function items<T>(cursor: Cursor, count: number, item: Kind<T>): T[] {
  const left = cursor.data.length - cursor.offset;
  if (count * item.least > left) throw new FormatError(`${count} values of at least ${item.least} bytes, ${left} bytes left`);
  return Array.from({ length: count }, () => item.read(cursor));
}

/** A record, declared before or behind this. */
export function nested<T>(of: () => Kind<T>): Kind<T> {
  return {
    get least() {
      return of().least;
    },
    read: (cursor) => of().read(cursor),
  };
}

export function record<T extends object>(name: string, kinds: { readonly [K in keyof T]: Kind<T[K]> }): Kind<T> {
  const fields = Object.entries(kinds) as [string, Kind<unknown>][];
  return {
    least: fields.reduce((sum, [, kind]) => sum + kind.least, 0),
    read(cursor) {
      const values: Record<string, unknown> = {};
      for (const [field, kind] of fields) values[field] = readField(`${name}.${field}`, kind, cursor);
      return values as T;
    },
  };
}

function readField(name: string, kind: Kind<unknown>, cursor: Cursor): unknown {
  try {
    return kind.read(cursor);
  } catch (error) {
    if (error instanceof FormatError) throw new FormatError(`${name}: ${error.message}`);
    throw error;
  }
}
