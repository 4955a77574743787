// Groups and states of the background that are decoded, and the jobs that decode them.

import { bytesOf } from "../bytes.ts";
import { FormatError } from "../errors.ts";
import type { Fetcher } from "../net/fetcher.ts";
import { together } from "../format/budget.ts";
import { Form } from "../format/layout.gen.ts";
import { companionLayers, companionsWith, mostLayers } from "../format/links.ts";
import type { Links, Wanted } from "../format/links.ts";
import type { Outcome, Share } from "./pool.ts";
import { describe, isCompanion, isVideo } from "../format/reader.ts";
import type { Chunk, CompanionChunk, Head } from "../format/reader.ts";
import type { Holdings, Plan, Step } from "./scheduler.ts";
import type { Companion, DecodeJob } from "../protocol.ts";
import type { Packed } from "../types.ts";

export interface DecodingEvents {
  ready(packed: Packed, before: Packed | null): void; // in the place of what was decoded before
  release(packed: Packed): void;
  warn(error: Error): void;
  changed(): void; // a job is done: there may be more to show, and more to do
}

interface With {
  readonly textured: boolean; // needed by textures of its chain
  readonly splatted: boolean; // the splats of its chain
}

interface State extends With {
  readonly layers: number;
  readonly worker: number;
}

const TRIES = 3; // of a job whose state a worker had dropped
const [FEWEST_TIMINGS, TIMINGS] = [2, 12]; // jobs of one number of layers that the load is measured over, at least and at most

export class Decoding implements Holdings {
  /** Counts what changes in what can be shown. */
  version = 0;
  wanted: Wanted = { textures: null, splats: true }; // of companions
  lastMs = 0; // of decoding the last group
  lastLayers = 0; // beyond the first, of that
  readonly #head: Head;
  readonly #links: Links;
  readonly #fetcher: Fetcher;
  readonly #share: Share;
  readonly #events: DecodingEvents;
  readonly #decoded = new Map<number, With & { packed: Packed; layers: number; bytes: number }>(); // by chunk, as all below
  readonly #states = new Map<number, State>();
  readonly #running = new Map<number, Step>();
  readonly #submitted = new Map<number, Step>();
  readonly #failed = new Set<number>();
  #lost: readonly Chunk[] = []; // that the file ends before or within
  readonly #tries = new Map<number, number>();
  #keep: ReadonlySet<number> = new Set();
  #bytesPerFrame = 0; // of the last groups
  readonly #timings = new Map<number, readonly { readonly ms: number; readonly frames: number }[]>(); // of the last groups, by layers beyond the first

  constructor(head: Head, links: Links, fetcher: Fetcher, share: Share, events: DecodingEvents) {
    this.#head = head;
    this.#links = links;
    this.#fetcher = fetcher;
    this.#share = share;
    this.#events = events;
  }

  packedOf(chunk: Chunk): Packed | null {
    return this.#decoded.get(chunk.number)?.packed ?? null;
  }

  /** True if everything that can be shown of a chunk is at hand. */
  isSettled(chunk: Chunk): boolean {
    return this.#decoded.has(chunk.number) || chunk.form === Form.EMPTY || this.#failed.has(chunk.number);
  }

  decodedAt(chunk: Chunk): number {
    const found = this.#decoded.get(chunk.number);
    return found === undefined || this.#lacks(chunk, found.layers, found) ? -1 : found.layers;
  }

  stateAt(chunk: Chunk): number {
    const { number } = chunk;
    const running = this.#running.get(number);
    if (running) return running.layers;
    const state = this.#states.get(number);
    if (state && this.#lacks(chunk, state.layers, state)) return -1;
    return state && this.#share.isAt(this.#links.rootOf(chunk), state.worker) ? state.layers : -1;
  }

  isFailed(chunk: Chunk): boolean {
    return this.#failed.has(chunk.number);
  }

  /** Companions with which a chunk is decoded, without those that can never be decoded. */
  companionsOf(chunk: Chunk): readonly CompanionChunk[] {
    return companionsWith(this.#head, chunk, this.wanted).filter((companion) => !this.isFailed(companion));
  }

  /** The pictures that a chunk is shown with where it has so many layers beyond the first; null where it is shown without. */
  picturesOf(chunk: Chunk, layers: number): CompanionChunk | null {
    const found = this.companionsOf(chunk).find(isVideo);
    return found !== undefined && companionLayers(chunk, found, layers + 1) > 0 ? found : null;
  }

  /** Changes what is wanted of companions: with the next plan what was left out is decoded. */
  want(change: Partial<Wanted>): void {
    this.wanted = { ...this.wanted, ...change };
    this.version++;
  }

  /** Gives up the pictures of a chunk and those that need them. */
  failPictures(pictures: Chunk, message: string): void {
    this.#fail(pictures, message);
    this.#events.changed();
  }

  /** True if the bytes of a chunk with so many layers beyond the first are at hand, and those of its companions but for pictures. */
  hasBytes({ chunk, layers }: Pick<Step, "chunk" | "layers">): boolean {
    const has = (other: Chunk, count: number): boolean => this.#fetcher.layersOf(other) >= count;
    return has(chunk, layers + 1) && this.companionsOf(chunk).every((companion) => isVideo(companion) || has(companion, companionLayers(chunk, companion, layers + 1)));
  }

  reachOf(chunk: Chunk): number {
    let layers = this.#fetcher.layersOf(chunk) - 1;
    while (layers >= 0 && !this.hasBytes({ chunk, layers })) layers--;
    return layers;
  }

  secondsOf({ frameCount }: Chunk, layers: number): number {
    return ((this.msPerFrame(layers) || this.msPerFrame(this.lastLayers)) * frameCount) / 1000;
  }

  bytesOf(chunk: Chunk): number {
    return this.#decoded.get(chunk.number)?.bytes ?? this.#bytesPerFrame * chunk.frameCount;
  }

  /** Groups that cannot be shown. */
  get failedGroups(): number {
    let count = 0;
    for (const number of this.#failed) if (this.#head.chunks[number].kind === "group") count++;
    return count;
  }

  /** Milliseconds of decoding a frame of one track with so many layers beyond the first, over the last groups; 0 before there are some. */
  msPerFrame(layers: number): number {
    const timings = this.#timings.get(layers) ?? [];
    const sum = (of: "ms" | "frames"): number => timings.reduce((total, timing) => total + timing[of], 0);
    return timings.length < FEWEST_TIMINGS ? 0 : sum("ms") / sum("frames");
  }

  /** Does the steps whose bytes are at hand, in their order; cancels all others that have not started. */
  run({ steps, keep }: Plan): void {
    this.#keep = keep;
    this.#share.clear();
    this.#submitted.clear();
    for (const step of steps) {
      if (!step.decode || this.#running.has(step.chunk.number)) continue;
      const layers = this.#layersFor(step);
      if (layers >= step.least) this.#submitted.set(step.chunk.number, { ...step, layers });
    }
    for (const step of [...this.#submitted.values()]) this.#submit(step);
  }

  /** Lets go of what is decoded and is not in the plan any more. States of the background may stay while they are small. */
  release(keepStatics: number): void {
    let statics = 0;
    for (const { packed, bytes } of this.#decoded.values()) if (packed.kind === "static") statics += bytes;
    for (const [number, { packed, bytes }] of this.#decoded) {
      if (this.#keep.has(number)) continue;
      if (packed.kind === "static") {
        if (statics <= keepStatics) continue;
        statics -= bytes;
      }
      this.#drop(number);
    }
  }

  /** Damaged chunks may be tried again, as with fewer layers. */
  forgive(): void {
    const damaged = [...this.#failed].map((number) => this.#head.chunks[number]).filter(isCompanion);
    for (const { dependsOn } of damaged) this.#forgetStates(dependsOn[0]); // they were made without it
    this.#failed.clear();
    this.#tries.clear();
    this.version++;
    for (const chunk of this.#lost) this.#giveUp(chunk);
  }

  /** Gives up the chunks that a file which ends at `size` has lost, and those that need them. */
  cut(size: number): void {
    this.#lost = this.#head.chunks.filter((chunk) => chunk.offset + chunk.size > size);
    for (const chunk of this.#lost) this.#giveUp(chunk);
    const where = `${describe(this.#lost[0])} and all behind it are missing`;
    this.#events.warn(new FormatError(`truncated, the file ends at byte ${size} of ${this.#head.size}: ${where}, copy it again`));
  }

  /** Releases all. */
  close(): void {
    this.#keep = new Set();
    for (const number of [...this.#decoded.keys()]) this.#drop(number);
  }

  /** Gives up a chunk and those that need it; returns how many these are. */
  #giveUp(chunk: Chunk): number {
    const before = this.#failed.size;
    for (const number of this.#links.withDependents(chunk.number)) this.#failed.add(number);
    this.version++;
    return this.#failed.size - before;
  }

  #fail(chunk: Chunk, message: string): void {
    const others = this.#giveUp(chunk) - 1;
    const more = others > 0 ? `, and ${others} that ${others === 1 ? "needs" : "need"} it` : "";
    const text = message.startsWith(`chunk ${chunk.number} `) ? message : `${describe(chunk)}: ${message}`;
    this.#events.warn(new FormatError(`${text}; it is skipped${more}`));
  }

  /** True if the chain of a chunk has splats that are wanted and can be decoded. */
  #hasSplats(chunk: Chunk): boolean {
    return this.companionsOf(this.#head.chunks[this.#links.rootOf(chunk)]).some(({ kind }) => kind === "splats");
  }

  /** True if a chunk was decoded without companions that are wanted now. */
  #lacks(chunk: Chunk, layers: number, { textured, splatted }: With): boolean {
    return (!textured && this.picturesOf(chunk, layers) !== null) || (!splatted && this.#hasSplats(chunk));
  }

  /** Layers beyond the first of a step for which bytes and states are at hand, or soon will be; -1 where there are none. */
  #layersFor({ chunk, layers }: Step): number {
    const most = Math.min(layers, this.reachOf(chunk));
    const previous = this.#links.previousOf(chunk);
    if (previous === null) return most;
    const state = this.#submitted.get(previous.number)?.layers ?? this.stateAt(previous);
    return state < Math.min(most, mostLayers(previous)) ? state : most;
  }

  #submit(step: Step): void {
    const { chunk, layers } = step;
    const job = {
      chunk: chunk.number,
      kind: chunk.kind as DecodeJob["kind"], // a plan has no others
      form: chunk.form,
      track: chunk.track,
      firstFrame: chunk.firstFrame,
      frameCount: chunk.frameCount,
      ranges: rangesOf(chunk, layers + 1),
      layers: layers === mostLayers(chunk) ? null : layers,
      previous: this.#links.previousOf(chunk)?.number ?? null,
      scale: this.#head.header.scale,
      stateOnly: !step.show,
    };
    let made: With = { textured: false, splatted: false };
    this.#share.submit({
      lane: this.#links.rootOf(chunk),
      start: () => {
        this.#submitted.delete(chunk.number);
        this.#running.set(chunk.number, step);
        made = { textured: this.picturesOf(chunk, layers) !== null, splatted: this.#hasSplats(chunk) };
        return { ...job, payload: this.#fetcher.payload(chunk, layers + 1), companions: this.#companionJobs(step), textured: made.textured };
      },
      settle: (outcome) => this.#settle(step, outcome, made),
    });
  }

  #companionJobs({ chunk, layers }: Step): Companion[] {
    const counted = this.companionsOf(chunk).map((companion) => ({ companion, count: companionLayers(chunk, companion, layers + 1) }));
    return counted.filter(({ companion, count }) => !isVideo(companion) && count > 0).map(({ companion, count }) => {
      const { number, kind, form } = companion;
      return { chunk: number, kind, form, payload: this.#fetcher.payload(companion, count), ranges: rangesOf(companion, count) };
    });
  }

  #settle(step: Step, outcome: Outcome, made: With): void {
    const { chunk, layers } = step;
    this.#running.delete(chunk.number);
    for (const { chunk: number, message } of outcome.damage) {
      if (!this.#failed.has(number)) this.#fail(this.#head.chunks[number], message); // or it was predicted from one that is damaged
    }
    if (outcome.kind === "decoded") {
      this.#states.set(chunk.number, { ...made, layers, worker: outcome.worker });
      this.#tries.delete(chunk.number);
      this.#time(step, outcome.ms);
      const { packed } = outcome;
      const crowd = packed === null ? null : this.#crowdOf(chunk, bytesOf(packed));
      if (crowd !== null) this.#fail(chunk, crowd);
      else if (packed !== null && this.#keep.has(chunk.number)) this.#add(chunk, packed, layers, made);
    } else {
      this.#share.clear(); // later chunks of the chain would fail, too: plan again
      this.#submitted.clear();
      this.#states.delete(chunk.number);
      if (outcome.missingState && this.#countTry(chunk) < TRIES) this.#forgetStates(this.#links.rootOf(chunk));
      else this.#fail(chunk, outcome.message);
    }
    this.#events.changed();
  }

  /** Why a group of so many bytes cannot be shown with those of other tracks; null where it can. */
  #crowdOf(chunk: Chunk, bytes: number): string | null {
    if (chunk.kind === "static") return null;
    let size = chunk.size;
    for (let track = 0; track < this.#head.tracks.length; track++) {
      const other = this.#head.chunkOfFrame(chunk.shownFirst, track);
      const decoded = other === chunk ? undefined : this.#decoded.get(other.number);
      if (decoded === undefined) continue;
      bytes += decoded.bytes;
      size += other.size;
    }
    if (bytes <= together(size) || size === chunk.size) return null;
    return `with those of other tracks it takes ${bytes} bytes, over ${together(size)}`;
  }

  #add(chunk: Chunk, packed: Packed, layers: number, made: With): void {
    const old = this.packedOf(chunk);
    const bytes = bytesOf(packed);
    this.#decoded.set(chunk.number, { ...made, packed, layers, bytes });
    if (packed.kind === "group") {
      const perFrame = bytes / packed.frameCount;
      this.#bytesPerFrame = this.#bytesPerFrame === 0 ? perFrame : (this.#bytesPerFrame + perFrame) / 2;
    }
    this.version++;
    this.#events.ready(packed, old);
    if (old !== null) this.#events.release(old);
  }

  #drop(number: number): void {
    const { packed } = this.#decoded.get(number)!;
    this.#decoded.delete(number);
    this.version++;
    this.#events.release(packed);
  }

  #time({ chunk: { kind, frameCount: frames }, layers }: Step, ms: number): void {
    if (kind !== "group") return; // the background is decoded once
    [this.lastMs, this.lastLayers] = [ms, layers];
    this.#timings.set(layers, [...(this.#timings.get(layers) ?? []), { ms, frames }].slice(-TIMINGS));
  }

  #countTry(chunk: Chunk): number {
    const tries = (this.#tries.get(chunk.number) ?? 0) + 1;
    this.#tries.set(chunk.number, tries);
    return tries;
  }

  #forgetStates(first: number): void {
    for (const number of this.#links.withDependents(first)) this.#states.delete(number);
  }
}

function rangesOf(chunk: Chunk, layers: number): { size: number; crc: number }[] {
  return chunk.layers.slice(0, layers).map(({ size, crc }) => ({ size, crc }));
}
