// Sources of bytes: ranges of a file, which can be cancelled.

import { joined } from "../bytes.ts";
import { SourceError } from "../errors.ts";

/** Takes bytes as they come: `bytes` lie at `offset` of the file. The array is its own to keep. */
export type Take = (bytes: Uint8Array, offset: number) => void;

/** Receives warnings and progress of a source. */
export interface SourceWatch {
  warn(error: Error): void; // it goes on: the network is tried again
  progress(bytes: number): void; // that arrived since the last call
}

/** A file to be read in ranges. Errors are SourceErrors; a read that is aborted rejects with the signal's reason. */
export interface Source {
  /** Bytes of the whole file; null while that is not known. */
  readonly size: number | null;
  /** True if the server sends requested bytes only; if it sends all, fewer layers save no time. */
  readonly isSelective: boolean;
  /** Bits a second as measured lately; 0 where nothing was measured or there is no network. */
  readonly bandwidth: number;
  /** Seconds until an answer begins, as measured lately; 0 as well. */
  readonly latency: number;
  watch: SourceWatch | null;
  /** Gives bytes from `offset` on, in their order, in pieces as they arrive; fewer than `length` only where the file ends. */
  read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void>;
  /** Announces the file's size, as its head has it. */
  expect(size: number): void;
  close(): void;
}

/** A range of a source as one array. */
export async function readBytes(source: Source, offset: number, length: number, signal?: AbortSignal): Promise<Uint8Array> {
  const pieces: Uint8Array[] = [];
  await source.read(offset, length, (bytes) => pieces.push(bytes), signal);
  return joined(pieces);
}

/** Common part of sources on this machine. */
abstract class LocalSource implements Source {
  readonly isSelective = true;
  readonly bandwidth = 0;
  readonly latency = 0;
  watch: SourceWatch | null = null;
  abstract readonly size: number;

  protected abstract slice(from: number, to: number): Promise<Uint8Array>;

  async read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void> {
    signal?.throwIfAborted();
    const bytes = await this.slice(offset, Math.min(offset + length, this.size));
    signal?.throwIfAborted();
    this.watch?.progress(bytes.length);
    if (bytes.length > 0) take(bytes, offset);
  }

  expect(): void {}

  close(): void {}
}

/** A file that was dropped or picked. */
export class BlobSource extends LocalSource {
  readonly #blob: Blob;

  constructor(blob: Blob) {
    super();
    this.#blob = blob;
  }

  get size(): number {
    return this.#blob.size;
  }

  protected async slice(from: number, to: number): Promise<Uint8Array> {
    try {
      return new Uint8Array(await this.#blob.slice(from, Math.max(from, to)).arrayBuffer());
    } catch (error) {
      const name = this.#blob instanceof File ? this.#blob.name : "the file";
      throw new SourceError(`${name}: bytes ${from} to ${to} could not be read, pick the file again`, { cause: error });
    }
  }
}

/** Bytes in memory. */
export class BytesSource extends LocalSource {
  readonly #bytes: Uint8Array;

  constructor(bytes: Uint8Array) {
    super();
    this.#bytes = bytes;
  }

  get size(): number {
    return this.#bytes.length;
  }

  protected async slice(from: number, to: number): Promise<Uint8Array> {
    return this.#bytes.slice(from, to);
  }
}
