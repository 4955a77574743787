// Plan of the next fetches and decodes, from the play head's position. Nothing here fetches or decodes.

import type { Timeline } from "./clock.ts";
import { Form } from "../format/layout.gen.ts";
import { mostLayers } from "../format/links.ts";
import type { Links } from "../format/links.ts";
import type { Chunk, Head } from "../format/reader.ts";

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
}

/** Position of the play head, and the extent that is wanted around it. */
export interface Outlook {
  readonly time: number; // s
  readonly loop: boolean;
  readonly fetchSeconds: number; // of content, ahead
  readonly decodeSeconds: number; // of content, ahead; not more than fetchSeconds
  readonly behindSeconds: number; // of content: what is decoded behind the play head is kept
  readonly memory: number; // bytes that decoded groups may take
  readonly layers: number;
  /** True if groups decoded with other layers are decoded again, with the chains that predict them. */
  readonly exact: boolean;
}

/** One chunk to fetch and, in a worker, to decode. */
export interface Step {
  readonly chunk: Chunk;
  readonly layers: number;
  show: boolean; // or only its state is wanted, for the next of its chain
  decode: boolean; // or it is only fetched, for later
  ahead: number; // s of content until a frame needs it; 0 or less: that at the play head does
}

/** A chunk that will be shown. */
export interface Coming {
  readonly chunk: Chunk;
  readonly ahead: number; // s, as of a step
}

/** Why a chunk is wanted. */
interface Need {
  readonly ahead: number; // s
  readonly decode: boolean;
}

export interface Plan {
  readonly steps: readonly Step[]; // in order
  readonly keep: ReadonlySet<number>; // chunks that are shown, or soon will be
  readonly chainCount: number; // that can be decoded beside each other
  readonly coming: readonly Coming[]; // groups and backgrounds that will be shown, decoded or not, in the order of time
}

const MOST_GROUPS = 4096; // of all tracks, ahead or behind: a hostile frame rate has a whole file within a second
const FEWEST_GROUPS = 64; // of each track, however many there are
const SURE_GROUPS = 2; // of each track, the shown one and the next: wanted whatever memory they take

/**
 * Steps for the frame at the play head first, then for those ahead in their order, from the start again with `loop`.
 *
 * A group predicted from another is decoded to its level or a coarser one. So within a chain the number of layers only falls;
 * a rise waits for the next group that stands alone. With `exact` it does not wait: the chain is decoded again, finer.
 */
export function plan(head: Head, links: Links, timeline: Timeline, outlook: Outlook, holdings: Holdings): Plan {
  const planner = new Planner(head, links, outlook, holdings);
  const { time, decodeSeconds, behindSeconds } = outlook;
  const now = timeline.frameAt(time);
  const most = Math.max(FEWEST_GROUPS, Math.floor(MOST_GROUPS / head.tracks.length));
  for (const [first, last] of framesAhead(timeline, outlook)) {
    for (const group of groupsBetween(head, first, last, most)) {
      const frame = Math.max(group.shownFirst, first);
      const ahead = timeline.startOf(frame) - time + (frame < now ? timeline.duration : 0);
      planner.addGroup(group, frame, frame === now ? 0 : ahead, ahead <= decodeSeconds);
    }
  }
  const behind = Math.max(timeline.frameAt(time - behindSeconds), now - most);
  for (const group of groupsBetween(head, behind, now)) planner.keep.add(group.number);
  return planner.plan();
}

/** First and last frames of the runs that lie before the play head. */
function framesAhead(timeline: Timeline, { time, loop, fetchSeconds }: Outlook): [number, number][] {
  const now = timeline.frameAt(time);
  const beyond = time + fetchSeconds - timeline.duration;
  const runs: [number, number][] = [[now, timeline.frameAt(time + fetchSeconds)]];
  if (loop && beyond > 0 && now > 0) runs.push([0, Math.min(now - 1, timeline.frameAt(beyond))]);
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

  constructor(head: Head, links: Links, outlook: Outlook, holdings: Holdings) {
    this.#head = head;
    this.#links = links;
    this.#outlook = outlook;
    this.#holdings = holdings;
    this.#groupsOfTrack = head.tracks.map(() => 0);
  }

  addGroup(group: Chunk, frame: number, ahead: number, isNear: boolean): void {
    const background = this.#head.staticOfFrame(frame);
    if (background !== null) this.#add(background, { ahead, decode: isNear });
    for (const chunk of background === null ? [group] : [background, group]) if (!this.#coming.has(chunk)) this.#coming.set(chunk, ahead);
    if (group.form === Form.EMPTY) return;
    const isSure = ++this.#groupsOfTrack[group.track] <= SURE_GROUPS;
    this.#bytes += this.#holdings.bytesOf(group);
    const decode = isNear && (isSure || this.#bytes <= this.#outlook.memory);
    if (decode) this.#chains.add(this.#links.rootOf(group));
    this.#add(group, { ahead, decode });
  }

  plan(): Plan {
    const steps = [...this.#steps.values()];
    const coming = Array.from(this.#coming, ([chunk, ahead]) => ({ chunk, ahead }));
    const urgent = steps.filter((step) => step.ahead <= 0).sort((a, b) => a.chunk.number - b.chunk.number);
    return { steps: [...urgent, ...steps.filter((step) => step.ahead > 0)], keep: this.keep, chainCount: this.#chains.size, coming };
  }

  /** Wants a chunk to be shown, and before it what it is predicted from, as far as that is not at hand. */
  #add(chunk: Chunk, need: Need): void {
    if (this.#holdings.isFailed(chunk)) return;
    if (need.decode) this.keep.add(chunk.number);
    const wanted = this.#wantedOf(chunk);
    const decoded = this.#holdings.decodedAt(chunk);
    if (decoded === wanted || (decoded >= 0 && !this.#outlook.exact)) return;
    const before: Chunk[] = [];
    let layers = wanted;
    for (let previous = this.#links.previousOf(chunk); previous !== null; previous = this.#links.previousOf(previous)) {
      const state = this.#stateOf(previous);
      if (state >= Math.min(layers, mostLayers(previous))) break;
      if (state >= 0 && !this.#outlook.exact) {
        layers = state;
        break;
      }
      before.push(previous);
    }
    for (const other of before.reverse()) this.#step(other, layers, false, need);
    this.#step(chunk, layers, true, need);
  }

  #wantedOf(chunk: Chunk): number {
    return chunk.kind === "static" ? mostLayers(chunk) : Math.min(this.#outlook.layers, mostLayers(chunk));
  }

  /** Of the state that will be there: that of a step takes the place of one at hand, be it coarser. */
  #stateOf(chunk: Chunk): number {
    return this.#steps.get(chunk.number)?.layers ?? this.#holdings.stateAt(chunk);
  }

  #step(chunk: Chunk, layers: number, show: boolean, { ahead, decode }: Need): void {
    const old = this.#steps.get(chunk.number);
    const step = old ?? { chunk, layers: Math.min(layers, mostLayers(chunk)), show, decode, ahead };
    step.show ||= show && decode;
    step.decode ||= decode;
    step.ahead = Math.min(step.ahead, ahead);
    this.#steps.set(chunk.number, step);
  }
}
