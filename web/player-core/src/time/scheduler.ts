// Plan of the next fetches and decodes, from the play head's position. Nothing here fetches or decodes.

import type { Timeline } from "./clock.ts";
import { Form } from "../format/layout.gen.ts";
import { mostLayers } from "../format/links.ts";
import type { Links } from "../format/links.ts";
import type { Chunk, Head } from "../format/reader.ts";
import type { Direction } from "../types.ts";

/** State on which a plan is based. Layers are counted beyond the first; -1: not at hand. */
export interface Holdings {
  /** Of a chunk that is decoded and packed. */
  decodedAt(chunk: Chunk): number;
  /** Of the state of a chunk in a worker, or soon in one. */
  stateAt(chunk: Chunk): number;
  /** True if it can never be decoded. */
  isFailed(chunk: Chunk): boolean;
  /** Bytes that it takes when it is decoded, measured or estimated. */
  bytesOf(chunk: Chunk): number;
  /** That the bytes at hand of a chunk and its companions are enough for. */
  reachOf(chunk: Chunk): number;
  /** Seconds that decoding it with so many layers takes, as measured lately; 0 before that. */
  secondsOf(chunk: Chunk, layers: number): number;
}

/** Position of the play head, and the extent that is wanted around it. */
export interface Outlook {
  readonly time: number; // s
  readonly loop: boolean;
  readonly direction: Direction;
  readonly isBack: boolean; // time goes down
  readonly fetchSeconds: number; // of content, ahead
  readonly decodeSeconds: number; // of content, ahead; not more than fetchSeconds
  readonly behindSeconds: number; // of content: what is decoded behind the play head is kept
  readonly memory: number; // bytes that decoded groups may take
  readonly layers: number; // that are fetched
  /** Layers that decoding bears: more bytes at hand than these need are of no use in time. */
  readonly bearable: number;
  /** True if decoding has all the time that it takes: nothing moves on, or all that comes is decoded. */
  readonly isResting: boolean;
  readonly speed: number; // content seconds a second
  /** True if groups are decoded with `layers` and no others, again where need be, with the chains that predict them. */
  readonly exact: boolean;
}

/** One chunk to fetch and, in a worker, to decode. */
export interface Step {
  readonly chunk: Chunk;
  readonly layers: number;
  readonly fetched: number; // layers that are fetched: some may come too late to be decoded
  readonly least: number; // layers with which it is decoded where the bytes of the others do not come in time
  show: boolean; // or only its state is wanted, for the next of its chain
  decode: boolean; // or it is only fetched, for later
  ahead: number; // s of content until a frame needs it; 0 or less: that at the play head does
}

/** A chunk that will be shown. */
export interface Coming {
  readonly chunk: Chunk;
  readonly ahead: number; // s, as of a step
}

/** A chunk that is decoded, and of which more layers are fetched. */
export interface More extends Coming {
  readonly layers: number;
}

/** Why a chunk is wanted. */
interface Need {
  readonly ahead: number; // s
  readonly left: number; // s of content until it was shown
  readonly decode: boolean;
}

export interface Plan {
  readonly steps: readonly Step[]; // in order
  readonly keep: ReadonlySet<number>; // chunks that are shown, or soon will be
  readonly chainCount: number; // that can be decoded beside each other
  readonly more: readonly More[];
  readonly coming: readonly Coming[]; // groups and backgrounds that will be shown, decoded or not, in the order of time
}

const MOST_GROUPS = 4096; // of all tracks, ahead or behind: a hostile frame rate has a whole file within a second
const FEWEST_GROUPS = 64; // of each track, however many there are
const NEAR = 0.5; // s of display time: what is shown so soon is decoded with the layers that have come (guess)
const SPARE = 1 / 2; // of the time until a group was shown: what decoding its chain again, finer, may take (guess)
const SURE_GROUPS = 2; // of each track, the shown one and the next: wanted whatever memory they take

/**
 * Steps for the frame at the play head first, then for those ahead in their order, from the start again with `loop`. Ahead is where time goes to.
 *
 * Chunks are fetched with `layers` and decoded with all that are at hand. A group predicted from another is decoded with as many layers or fewer, so
 * within a chain their number falls; it rises with the next group that stands alone, or where finer bytes are at hand and there is time to decode the chain
 * again. With `exact` it is, time or not.
 */
export function plan(head: Head, links: Links, timeline: Timeline, outlook: Outlook, holdings: Holdings): Plan {
  const planner = new Planner(head, links, outlook, holdings);
  const { time, decodeSeconds, behindSeconds, isBack } = outlook;
  const now = timeline.frameAt(time);
  const most = Math.max(FEWEST_GROUPS, Math.floor(MOST_GROUPS / head.tracks.length));
  const added = new Set<Chunk>();
  for (const run of runsAhead(timeline, outlook)) {
    const first = run.isBack ? Math.max(run.first, run.last - most) : run.first;
    const groups = groupsBetween(head, first, run.last, most);
    for (const group of run.isBack ? groups.reverse() : groups) {
      if (added.has(group)) continue; // it is shown before, on the way there
      added.add(group);
      const [begin, end] = [Math.max(group.shownFirst, first), Math.min(group.shownEnd, run.last + 1)];
      const frame = run.isBack ? end - 1 : begin;
      const ahead = run.ahead + (run.isBack ? run.from - timeline.startOf(end) : timeline.startOf(begin) - run.from);
      const left = ahead + timeline.startOf(run.isBack ? end : group.shownEnd) - timeline.startOf(begin);
      planner.addGroup(group, frame, { ahead: frame === now ? 0 : ahead, left, decode: ahead <= decodeSeconds });
    }
  }
  const behind = timeline.frameAt(time + (isBack ? behindSeconds : -behindSeconds));
  const kept = isBack ? [now, Math.min(behind, now + most)] as const : [Math.max(behind, now - most), now] as const;
  for (const group of groupsBetween(head, ...kept)) planner.keep.add(group.number);
  return planner.plan();
}

/** Frames that are shown one after the other, up or down. */
interface Run {
  readonly first: number;
  readonly last: number; // not below the first
  readonly isBack: boolean;
  readonly from: number; // s, time at which it begins
  readonly ahead: number; // s of content until then
}

/** Runs that lie before the play head: up to the end or down to the start, and on from there. */
function runsAhead(timeline: Timeline, { time, loop, direction, isBack, fetchSeconds }: Outlook): Run[] {
  const { duration, frameCount } = timeline;
  const now = timeline.frameAt(time);
  const upTo = (from: number, first: number, ahead: number): Run => ({ first, last: timeline.frameAt(from + fetchSeconds - ahead), isBack: false, from, ahead });
  const downTo = (from: number, last: number, ahead: number): Run => ({ first: timeline.frameAt(from - fetchSeconds + ahead), last, isBack: true, from, ahead });
  const left = isBack ? time : duration - time;
  const runs = [isBack ? downTo(time, now, 0) : upTo(time, now, 0)];
  if (left >= fetchSeconds) return runs;
  if (direction === "alternate" && (loop || !isBack)) runs.push(isBack ? upTo(0, 0, left) : downTo(duration, frameCount - 1, left));
  else if (loop && isBack && now < frameCount - 1) runs.push(downTo(duration, frameCount - 1, left));
  else if (loop && !isBack && now > 0) runs.push(upTo(0, 0, left));
  return runs;
}

/** Groups that hold a frame from `first` to `last`, the first `most` of each track, in the order of the file, which is that of time. */
export function groupsBetween(head: Head, first: number, last: number, most = Infinity): Chunk[] {
  const groups: Chunk[] = [];
  for (let track = 0; track < head.tracks.length; track++) {
    for (let [frame, count] = [first, 0]; frame <= last && count < most; count++) {
      const group = head.chunkOfFrame(frame, track);
      groups.push(group);
      frame = group.shownEnd;
    }
  }
  return groups.sort((a, b) => a.number - b.number);
}

class Planner {
  readonly keep = new Set<number>();
  readonly #head: Head;
  readonly #links: Links;
  readonly #outlook: Outlook;
  readonly #holdings: Holdings;
  readonly #steps = new Map<number, Step>(); // by chunk
  readonly #chains = new Set<number>();
  readonly #coming = new Map<Chunk, number>();
  readonly #groupsOfTrack: number[];
  #bytes = 0; // decoded
  readonly #fetched = new Map<Chunk, number>(); // layers
  readonly #more: More[] = [];
  #spent = 0; // s, of decoding chains again

  constructor(head: Head, links: Links, outlook: Outlook, holdings: Holdings) {
    this.#head = head;
    this.#links = links;
    this.#outlook = outlook;
    this.#holdings = holdings;
    this.#groupsOfTrack = head.tracks.map(() => 0);
  }

  addGroup(group: Chunk, frame: number, need: Need): void {
    const background = this.#head.staticOfFrame(frame);
    if (background !== null) this.#add(background, need);
    for (const chunk of background === null ? [group] : [background, group]) if (!this.#coming.has(chunk)) this.#coming.set(chunk, need.ahead);
    if (group.form === Form.EMPTY) return;
    const isSure = ++this.#groupsOfTrack[group.track] <= SURE_GROUPS;
    this.#bytes += this.#holdings.bytesOf(group);
    const decode = need.decode && (isSure || this.#bytes <= this.#outlook.memory);
    if (decode) this.#chains.add(this.#links.rootOf(group));
    this.#add(group, { ...need, decode });
  }

  plan(): Plan {
    const steps = [...this.#steps.values()];
    const coming = Array.from(this.#coming, ([chunk, ahead]) => ({ chunk, ahead }));
    const urgent = steps.filter((step) => step.ahead <= 0).sort((a, b) => a.chunk.number - b.chunk.number);
    return { steps: [...urgent, ...steps.filter((step) => step.ahead > 0)], keep: this.keep, chainCount: this.#chains.size, more: this.#more, coming };
  }

  /** Wants a chunk to be shown, and before it what it is predicted from, as far as that is not at hand. */
  #add(chunk: Chunk, need: Need): void {
    if (this.#holdings.isFailed(chunk)) return;
    if (need.decode) this.keep.add(chunk.number);
    const decoded = this.#holdings.decodedAt(chunk);
    const { layers, fetched, before } = this.#wayTo(chunk);
    this.#fetched.set(chunk, fetched);
    const { exact, speed } = this.#outlook;
    if (exact ? decoded === layers : this.#refine(chunk, decoded, fetched, need)) return;
    if (decoded >= 0 && !exact) {
      if (decoded < fetched) this.#more.push({ chunk, layers: fetched, ahead: need.ahead });
    } else {
      const isSoon = !exact && chunk.kind === "group" && need.ahead <= NEAR * speed;
      this.#stepThrough([...before, chunk], { layers, fetched, least: isSoon ? 0 : layers }, need);
    }
  }

  /** Layers with which a chunk is decoded and fetched, and the chunks of its chain that are decoded before it. */
  #wayTo(chunk: Chunk): { layers: number; fetched: number; before: Chunk[] } {
    let layers = chunk.kind === "static" ? mostLayers(chunk) : Math.min(this.#outlook.layers, mostLayers(chunk));
    let fetched = layers;
    const before: Chunk[] = [];
    for (let previous = this.#links.previousOf(chunk); previous !== null; previous = this.#links.previousOf(previous)) {
      const state = this.#stateOf(previous);
      if (state >= Math.min(layers, mostLayers(previous))) break;
      if (state >= 0 && !this.#outlook.exact) {
        layers = state;
        const possible = this.#fetched.get(previous) ?? Math.max(state, this.#finest(previous).layers);
        if (possible < mostLayers(previous)) fetched = Math.min(fetched, possible);
        break;
      }
      before.unshift(previous);
    }
    return { layers, fetched, before };
  }

  /** Decodes a chunk with the layers that are at hand, where they are enough and there is time for its chain. True if no other step is needed. */
  #refine(chunk: Chunk, decoded: number, wanted: number, need: Need): boolean {
    const { layers, chain } = this.#finest(chunk);
    const isShown = decoded >= 0;
    const isFiner = need.decode && (isShown ? layers > decoded : layers >= wanted);
    if (!isFiner || !((chain.length === 1 && !isShown) || this.#hasTime(chain, layers, isShown, need))) return false;
    this.#stepThrough(chain, { layers, fetched: Math.max(layers, wanted), least: layers }, need);
    return true;
  }

  /** The most layers of a chunk that bytes at hand allow, and the end of its chain that is decoded for them. */
  #finest(chunk: Chunk): { layers: number; chain: Chunk[] } {
    let layers = Math.min(this.#outlook.bearable, this.#holdings.reachOf(chunk));
    const chain = [chunk];
    const isReached = (other: Chunk): boolean => this.#holdings.stateAt(other) >= Math.min(layers, mostLayers(other));
    for (let previous = this.#links.previousOf(chunk); previous !== null; previous = this.#links.previousOf(previous)) {
      const step = this.#steps.get(previous.number);
      if (step === undefined && isReached(previous)) break;
      const limit = step?.layers ?? this.#holdings.reachOf(previous);
      if (limit < mostLayers(previous)) layers = Math.min(layers, limit);
      if (step !== undefined) break;
      chain.unshift(previous);
    }
    const start = chain.slice(0, -1).map(isReached).lastIndexOf(true) + 1; // fewer layers need less
    return { layers, chain: chain.slice(start) };
  }

  /** True if a chain can be decoded before most of it was shown, beside what was added before. */
  #hasTime(chain: readonly Chunk[], layers: number, isShown: boolean, { ahead, left }: Need): boolean {
    const { isResting, speed } = this.#outlook;
    if (isResting && (isShown || ahead > 0)) return true;
    const seconds = chain.reduce((sum, chunk) => sum + this.#holdings.secondsOf(chunk, layers), this.#spent);
    if (seconds >= (SPARE * left) / speed) return false;
    this.#spent = seconds;
    return true;
  }

  /** Of the state that will be there: that of a step takes the place of one at hand, be it coarser. */
  #stateOf(chunk: Chunk): number {
    return this.#steps.get(chunk.number)?.layers ?? this.#holdings.stateAt(chunk);
  }

  /** Steps for the end of a chain, of which the last chunk is shown. */
  #stepThrough(chain: readonly Chunk[], { layers, fetched, least }: Pick<Step, "layers" | "fetched" | "least">, { ahead, decode }: Need): void {
    for (const chunk of chain) {
      const most = mostLayers(chunk);
      const old = this.#steps.get(chunk.number);
      const step = old ?? { chunk, layers: Math.min(layers, most), fetched: Math.min(fetched, most), least: Math.min(least, most), show: false, decode, ahead };
      step.show ||= chunk === chain.at(-1) && decode;
      step.decode ||= decode;
      step.ahead = Math.min(step.ahead, ahead);
      this.#steps.set(chunk.number, step);
    }
  }
}
