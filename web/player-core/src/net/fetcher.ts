// Keeps the bytes of chunks that have come, and asks a source for those that are wanted next.

import { joined } from "../bytes.ts";
import { SourceError } from "../errors.ts";
import { sizeOfLayers } from "../format/links.ts";
import type { Chunk, Head } from "../format/reader.ts";
import type { Source } from "./source.ts";

/** The first layers of a chunk, or of another of the head's pieces: this file calls them all chunks. */
export interface Wish {
  readonly chunk: Chunk;
  readonly count: number;
  readonly when: When;
}

/** Urgency of bytes: for the frame at the play head, soon, or later, when a request is worthwhile. */
export type When = "now" | "soon" | "later";

export interface FetcherEvents {
  arrived(): void; // a chunk has a layer more, or the next request may be made
  failed(error: unknown): void; // a source gave up
}

const JOIN = [1024, 1 / 4] as const; // bytes, at least, and share of those that come while a server answers: fetching unwanted ones costs less than a further request (guess)
const URGENT_REQUESTS = 4; // at a time: the chunks of the frame at the play head may be scattered
const REQUESTS = 6; // at a time: the number of connections that browsers open to a host
const BATCH = [1 << 16, 1 << 22] as const; // bytes of a request, at least and at most; in between, those of one second
const OVERLAP = 0.1; // s before a request has ended, the next one is answered: at once they would only delay each other

interface Held {
  pieces: Uint8Array[];
  length: number; // bytes from the chunk's first on
}

interface Request {
  at: number; // next byte
  readonly to: number;
  readonly controller: AbortController;
}

interface Range {
  readonly behind: number; // the bytes of its chunk that are at hand
  readonly from: number;
  readonly to: number;
  readonly when: When;
}

export class Fetcher {
  readonly #chunks: readonly Chunk[];
  readonly #source: Source;
  readonly #events: FetcherEvents;
  readonly #memory: number;
  readonly #held = new Map<number, Held>(); // by offset of the chunk, those used last at the end
  #heldBytes = 0;
  #wanted = new Set<number>();
  #requests: Request[] = [];
  #fetchedBytes = 0;

  /** `memory`: bytes that chunks may take that are not wanted any more. */
  constructor(head: Head, source: Source, events: FetcherEvents, memory: number) {
    this.#chunks = head.pieces;
    this.#source = source;
    this.#events = events;
    this.#memory = memory;
  }

  /** Bytes of chunks that have come, ever. */
  get fetchedBytes(): number {
    return this.#fetchedBytes;
  }

  /** Bytes of chunks that are at hand. */
  get heldBytes(): number {
    return this.#heldBytes;
  }

  get isFetching(): boolean {
    return this.#requests.length > 0;
  }

  /** Number of a chunk's complete layers that are at hand. */
  layersOf(chunk: Chunk): number {
    let rest = this.#held.get(chunk.offset)?.length ?? 0;
    let layers = 0;
    while (layers < chunk.layers.length && rest >= chunk.layers[layers].size) rest -= chunk.layers[layers++].size;
    return layers;
  }

  /** A copy of the first layers of a chunk. */
  payload(chunk: Chunk, layers: number): Uint8Array<ArrayBuffer> {
    const held = this.#held.get(chunk.offset)!;
    if (held.pieces.length > 1) held.pieces = [joined(held.pieces)];
    this.#held.delete(chunk.offset);
    this.#held.set(chunk.offset, held);
    return held.pieces[0].slice(0, sizeOfLayers(chunk, layers)) as Uint8Array<ArrayBuffer>;
  }

  /** Fetches these, in their order; what is on its way and not among them is cancelled. */
  want(wishes: readonly Wish[]): void {
    this.#wanted = new Set(wishes.map(({ chunk }) => chunk.offset));
    const missing = this.#missingOf(wishes);
    for (const request of this.#requests) {
      if (!missing.some(({ from, to }) => from <= request.at + this.#join && from < request.to && to > request.at)) request.controller.abort();
    }
    this.#requests = this.#requests.filter(({ controller }) => !controller.signal.aborted);
    if (isWorthwhile(this.#notOnTheirWay(missing))) this.#askFor(missing);
    this.#evict();
  }

  /** Keeps what of these bytes of the file goes on where the bytes at hand of a chunk end. */
  put(bytes: Uint8Array, offset: number): void {
    const end = offset + bytes.length;
    for (let k = this.#chunkAt(offset); k < this.#chunks.length && this.#chunks[k].offset < end; k++) {
      const chunk = this.#chunks[k];
      const held = this.#held.get(chunk.offset) ?? { pieces: [], length: 0 };
      const from = chunk.offset + held.length;
      const to = Math.min(end, chunk.offset + chunk.size);
      if (from < offset || from >= to) continue;
      held.pieces.push(bytes.slice(from - offset, to - offset)); // a copy: a view would keep all of what came with it
      held.length += to - from;
      this.#heldBytes += to - from;
      this.#fetchedBytes += to - from;
      this.#held.set(chunk.offset, held);
    }
  }

  close(): void {
    for (const { controller } of this.#requests) controller.abort();
    this.#requests = [];
    this.#held.clear();
    this.#heldBytes = 0;
  }

  /** Ranges of these that are not at hand, each byte once: of a chunk more layers may be wanted later than the first. */
  #missingOf(wishes: readonly Wish[]): Range[] {
    const ends = new Map<number, number>(); // by offset of the chunk
    const ranges: Range[] = [];
    for (const { chunk, count, when } of wishes) {
      const behind = chunk.offset + (this.#held.get(chunk.offset)?.length ?? 0);
      const from = ends.get(chunk.offset) ?? behind;
      const to = chunk.offset + sizeOfLayers(chunk, count);
      if (from < to) ranges.push({ behind, from, to, when });
      ends.set(chunk.offset, Math.max(from, to));
    }
    return ranges;
  }

  #askFor(missing: readonly Range[]): void {
    for (;;) {
      const rest = this.#notOnTheirWay(missing); // a request may have taken some with it that lie between others
      if (rest.length === 0 || !this.#mayAsk(rest[0])) return;
      this.#ask(this.#batch(rest));
    }
  }

  /** Those of which nothing is on its way, nor of the bytes before in their chunk: bytes that come before these are lost. */
  #notOnTheirWay(ranges: readonly Range[]): Range[] {
    return ranges.filter(({ behind, to }) => !this.#requests.some((request) => request.at < to && behind < request.to));
  }

  #mayAsk({ when }: Range): boolean {
    if (when === "now") return this.#requests.length < URGENT_REQUESTS;
    const left = this.#requests.reduce((sum, { at, to }) => sum + to - at, 0);
    return left <= this.#overlap && this.#requests.length < REQUESTS;
  }

  /** Bytes: what comes until the first of the next request does, and some more. */
  get #overlap(): number {
    return ((OVERLAP + this.#source.latency) * this.#source.bandwidth) / 8;
  }

  get #join(): number {
    return Math.max(JOIN[0], (JOIN[1] * this.#source.latency * this.#source.bandwidth) / 8);
  }

  /** Takes ranges that lie together from the start of `rest`. */
  #batch(rest: Range[]): Pick<Range, "from" | "to"> {
    const { bandwidth } = this.#source;
    const most = bandwidth > 0 ? Math.min(Math.max(bandwidth / 8, BATCH[0]), BATCH[1]) : 4 * BATCH[0];
    const { from } = rest[0];
    let { to } = rest.shift()!;
    const isNext = (other: Range): boolean => other.from >= to && other.from <= to + this.#join && other.to <= from + most;
    const isComing = (other: Range): boolean => this.#requests.some((request) => request.at < other.from && request.to > to);
    while (rest.length > 0 && isNext(rest[0]) && !isComing(rest[0])) ({ to } = rest.shift()!);
    return { from, to };
  }

  #ask({ from, to }: Pick<Range, "from" | "to">): void {
    const request: Request = { at: from, to, controller: new AbortController() };
    const { signal } = request.controller;
    this.#requests.push(request);
    const take = (bytes: Uint8Array, offset: number): void => {
      if (signal.aborted) return;
      this.#take(request, bytes, offset);
    };
    this.#source.read(from, to - from, take, signal).then(
      () => this.#finish(request),
      (error: unknown) => {
        if (!signal.aborted) this.#finish(request, error);
      },
    );
  }

  #take(request: Request, bytes: Uint8Array, offset: number): void {
    const left = request.to - request.at;
    const chunk = this.#chunks[this.#chunkAt(request.at)];
    const layers = this.layersOf(chunk);
    this.put(bytes, offset);
    request.at = offset + bytes.length;
    const isRunningOut = left > this.#overlap && request.to - request.at <= this.#overlap;
    if (isRunningOut || request.at >= chunk.offset + chunk.size || this.layersOf(chunk) > layers) this.#events.arrived();
  }

  #finish(request: Request, error?: unknown): void {
    this.#requests = this.#requests.filter((other) => other !== request);
    const { at, to } = request;
    if (error === undefined && at < to && this.#source.size === null) error = new SourceError(`bytes ${at} to ${to - 1} did not come, load it again`);
    if (error === undefined) this.#events.arrived();
    else this.#events.failed(error);
  }

  #chunkAt(offset: number): number {
    let [low, high] = [0, this.#chunks.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.#chunks[middle].offset <= offset) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  #evict(): void {
    let unwanted = 0;
    for (const [offset, { length }] of this.#held) if (!this.#wanted.has(offset)) unwanted += length;
    for (const [offset, { length }] of this.#held) {
      if (unwanted <= this.#memory) return;
      if (this.#wanted.has(offset)) continue;
      this.#held.delete(offset);
      this.#heldBytes -= length;
      unwanted -= length;
    }
  }
}

/** True if a request should start now: ranges that are wanted later are collected first. */
function isWorthwhile(ranges: readonly Range[]): boolean {
  return ranges.some(({ when }) => when !== "later") || ranges.reduce((sum, { from, to }) => sum + to - from, 0) >= BATCH[0];
}
