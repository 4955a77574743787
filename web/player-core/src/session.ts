// One open file: what of it is fetched, decoded and shown, kept in step with the play head.

import { Adaptive } from "./time/adaptive.ts";
import { Timeline } from "./time/clock.ts";
import { Decoding } from "./time/decoding.ts";
import type { DecodingEvents } from "./time/decoding.ts";
import { Fetcher } from "./net/fetcher.ts";
import type { When, Wish } from "./net/fetcher.ts";
import { Form } from "./format/layout.gen.ts";
import { Links, companionLayers, sizeWithCompanions } from "./format/links.ts";
import type { Opened } from "./net/opening.ts";
import { Picture } from "./time/picture.ts";
import type { Share } from "./time/pool.ts";
import { isVideo } from "./format/reader.ts";
import type { Chunk, Head } from "./format/reader.ts";
import { plan } from "./time/scheduler.ts";
import type { Plan, Step } from "./time/scheduler.ts";
import type { Source } from "./net/source.ts";
import { Textures } from "./time/textures.ts";
import type { Layers, Stats } from "./types.ts";

export interface Limits {
  readonly bufferSeconds: number; // of bytes fetched ahead, at normal speed
  readonly decodedSeconds: number; // of groups decoded ahead, at normal speed; 0.5 at least, as plans are made so often
  readonly memory: number; // bytes that decoded groups may take
}

/** Position and direction of the play head. */
export interface Aim {
  readonly time: number; // s
  readonly speed: number; // content seconds a second
  readonly loop: boolean;
  readonly layers: Layers;
  readonly splats: boolean; // true if they are wanted
  readonly isWaiting: boolean; // it should play and cannot
}

export interface SessionEvents extends DecodingEvents {
  failed(error: unknown): void;
  textured(): void; // a texture came, or went
}

const BEHIND = 1; // s of content: what is decoded behind the play head is kept
const COMPRESSED = 1 << 25; // bytes of chunks kept though they are not wanted now: they may be again
const LATER = 3 / 4; // of the seconds that are fetched ahead: what lies beyond waits until it fills a request
const MOST_BUFFERED = 60; // s of content that `statsAt` looks ahead
const STATICS = 1 / 4; // share of the memory that states of the background may keep

/** Numbers that are a session's own. */
type SessionStats = Omit<Stats, "bandwidthMbps" | "fetchedBytes" | "stalls">;

/** Before there is one. */
export const NO_STATS: SessionStats = {
  mbps: 0, decodeMs: 0, decodeLoad: 0, bufferedSeconds: 0, layers: 0, wholeLayers: 0, skippedGroups: 0,
  textures: "none", textureCodec: null, textureReason: "", backgroundLate: false,
};

export class Session {
  readonly head: Head;
  readonly timeline: Timeline;
  readonly picture: Picture;
  readonly decoding: Decoding;
  readonly textures: Textures;
  readonly fetcher: Fetcher;
  readonly #links: Links;
  readonly #source: Source;
  readonly #share: Share;
  readonly #limits: Limits;
  readonly #events: SessionEvents;
  readonly #adaptive: Adaptive;
  readonly #movingTracks: number; // that have something to decode
  readonly #rates = new Map<string, number>(); // bits/s by layers beyond the first and what is wanted with them
  #plan: Plan = { steps: [], keep: new Set(), chainCount: 0, coming: [] };
  #size: number | null = null; // of the file, as the source had it last
  #speed = 1;

  constructor({ head, first, decodable }: Opened, source: Source, share: Share, limits: Limits, events: SessionEvents, textures: boolean) {
    this.head = head;
    this.#source = source;
    this.#share = share;
    this.#limits = limits;
    this.#events = events;
    this.#movingTracks = head.tracks.filter((groups) => groups.some((group) => group.form !== Form.EMPTY)).length;
    this.timeline = timelineOf(head);
    this.#links = new Links(head);
    this.fetcher = new Fetcher(head, source, { arrived: events.changed, failed: events.failed }, COMPRESSED);
    this.fetcher.put(first, 0);
    this.decoding = new Decoding(head, this.#links, this.fetcher, share, events);
    this.textures = new Textures(head, this.fetcher, this.decoding, { warn: events.warn, changed: events.textured }, { on: textures, decodable });
    this.picture = new Picture(head, this.decoding, this.textures);
    this.#adaptive = new Adaptive(head, this.timeline, this.#bandwidth, this.decoding.wanted);
  }

  /** Layers beyond the first that "auto" chooses now. */
  get level(): number {
    return this.#adaptive.level;
  }

  /** Makes a new plan and starts fetching and decoding; chunks that are no longer wanted are cancelled and released. */
  pump(aim: Aim): void {
    this.#speed = aim.speed;
    this.#checkSize();
    const { bufferSeconds, memory } = this.#limits;
    const decodedSeconds = Math.max(this.#limits.decodedSeconds, 0.5);
    const outlook = {
      time: aim.time,
      loop: aim.loop,
      fetchSeconds: Math.max(bufferSeconds, decodedSeconds) * aim.speed,
      decodeSeconds: decodedSeconds * aim.speed,
      behindSeconds: BEHIND,
      memory,
      layers: aim.layers === "auto" ? this.#adaptive.level : aim.layers,
      exact: aim.layers !== "auto",
    };
    this.textures.loop = aim.loop;
    if (aim.splats !== this.decoding.wanted.splats) this.decoding.want({ splats: aim.splats });
    const made = plan(this.head, this.#links, this.timeline, outlook, this.decoding);
    const keep = new Set(made.keep);
    this.picture.addTo(keep);
    this.#plan = { ...made, keep };
    this.decoding.run(this.#plan);
    this.decoding.release(STATICS * memory);
    const whenOf = (ahead: number): When => (ahead <= 0 ? "now" : ahead < LATER * outlook.fetchSeconds ? "soon" : "later");
    const wishesOf = (steps: readonly Step[]): Wish[] => steps.flatMap((step) => this.#wishesOf(step, whenOf(step.ahead)));
    const urgent = wishesOf(made.steps.filter(({ ahead }) => ahead <= 0));
    const later = wishesOf(made.steps.filter(({ ahead }) => ahead > 0));
    this.fetcher.want([...this.#pictureWishes(made, whenOf), ...urgent, ...this.#slowWishes(made, aim.time, aim.time + outlook.fetchSeconds), ...later]);
    if (aim.layers === "auto") this.#adapt(aim);
  }

  /** Seconds of content from a time on that can be shown; Infinity if that is all. It looks for `most` of them, or some more. */
  readyAhead(time: number, loop: boolean, most: number): number {
    const { duration, frameCount } = this.timeline;
    let frame = this.timeline.frameAt(time);
    let sum = this.timeline.startOf(frame) - time;
    while (sum < most && this.picture.isReady(frame)) {
      const next = this.#nextBorder(frame);
      sum += this.timeline.startOf(next) - this.timeline.startOf(frame);
      frame = next % frameCount;
      if (frame === 0 && (!loop || sum >= duration)) return Infinity;
    }
    return Math.max(0, sum);
  }

  /** True if everything that is wanted soon is decoded, however long that lasts. */
  get isSated(): boolean {
    return this.#firstAhead((step) => step.decode && !this.decoding.isSettled(step.chunk)) === Infinity;
  }

  /** Decoding time over playing time, of the workers that have something to do. */
  get load(): number {
    const { frameCount, duration } = this.timeline;
    const workers = Math.max(1, Math.min(this.#share.size, this.#plan.chainCount));
    const framesPerMs = (this.#speed * this.#movingTracks * frameCount) / (1000 * duration);
    return (this.decoding.msPerFrame * framesPerMs) / workers;
  }

  /** Statistics at a time, s. */
  statsAt(time: number, loop: boolean): SessionStats {
    const { shown, wholeLayers } = this.picture;
    const layers = Math.max(0, ...(shown?.groups ?? []).map((group) => group?.layers ?? 0));
    const { duration } = this.timeline;
    return {
      mbps: this.rateAt(layers) / 1e6,
      decodeMs: this.decoding.lastMs,
      decodeLoad: this.load,
      bufferedSeconds: Math.min(this.readyAhead(time, loop, MOST_BUFFERED), loop ? duration : duration - time),
      layers,
      wholeLayers,
      skippedGroups: this.decoding.failedGroups,
      ...this.textures.statsOf(shown),
    };
  }

  /** Bits a second of content of the whole stream, with `layers` layers beyond the first. */
  rateAt(layers: number): number {
    const { wanted } = this.decoding;
    const key = `${layers} ${wanted.textures} ${wanted.splats}`;
    let rate = this.#rates.get(key);
    if (rate === undefined) {
      const shown = this.head.chunks.filter(({ kind }) => kind === "static" || kind === "group");
      const layersOf = (chunk: Chunk): number => (chunk.kind === "static" ? chunk.layers.length : layers + 1);
      const size = shown.reduce((sum, chunk) => sum + sizeWithCompanions(this.head, chunk, layersOf(chunk), wanted), 0);
      rate = (8 * size) / this.timeline.duration;
      this.#rates.set(key, rate);
    }
    return rate;
  }

  /** Fetches and decodes nothing more; what is decoded can still be shown. */
  stop(): void {
    this.#share.clear();
    this.fetcher.close();
  }

  close(): void {
    this.stop();
    this.textures.close();
    this.decoding.close();
  }

  /** A chunk's layers, and behind them what comes with these. */
  #wishesOf({ chunk, layers }: Step, when: When): Wish[] {
    const count = layers + 1;
    const others = this.decoding.companionsOf(chunk).filter((other) => !isVideo(other) || (chunk.kind === "group" && !this.textures.isFar(chunk)));
    const companions = others.map((other) => ({ chunk: other, count: companionLayers(chunk, other, count), when }));
    return [{ chunk, count, when }, ...companions];
  }

  /** Pictures that lie before those of the play head in their video, and those of groups that are decoded already. */
  #pictureWishes({ coming, steps }: Plan, whenOf: (ahead: number) => When): Wish[] {
    const layers = new Map(steps.map((step) => [step.chunk, step.layers]));
    return coming.flatMap(({ chunk, ahead }) => {
      if (chunk.kind === "static" || this.textures.isFar(chunk)) return [];
      const pictures = this.decoding.picturesOf(chunk, layers.get(chunk) ?? this.decoding.decodedAt(chunk));
      if (pictures === null || (ahead > 0 && layers.has(chunk))) return [];
      const lead = ahead > 0 ? [pictures] : this.textures.leadTo(pictures);
      return lead.map((other) => ({ chunk: other, count: 1, when: whenOf(ahead) }));
    });
  }

  /** Layers of the backgrounds' videos, behind all that the frame at the play head waits for. */
  #slowWishes({ coming }: Plan, from: number, to: number): Wish[] {
    const [first, last] = [this.timeline.frameAt(from), this.timeline.frameAt(to)];
    return coming.flatMap(({ chunk }) => (chunk.kind === "static" ? this.textures.layersOf(chunk, first, last) : [])).map((layer) => ({ chunk: layer, count: 1, when: "soon" }));
  }

  #adapt(aim: Aim): void {
    this.#adaptive.wanted = this.decoding.wanted;
    const before = this.#adaptive.level;
    const level = this.#adaptive.decide({
      now: performance.now(),
      time: aim.time,
      speed: aim.speed,
      bandwidth: this.#bandwidth,
      fetched: this.#firstAhead((step) => !this.decoding.hasBytes(step)) / aim.speed,
      decoded: this.#firstAhead(({ decode, chunk }) => decode && !this.decoding.isSettled(chunk)) / aim.speed,
      load: this.load,
      isWaiting: aim.isWaiting,
    });
    if (level === before) return;
    this.decoding.resetTimings();
    this.#events.changed(); // to plan with it
  }

  /** A source that sends everything in any case sends nothing sooner where less is asked for. */
  get #bandwidth(): number {
    return this.#source.isSelective ? this.#source.bandwidth : 0;
  }

  /** Seconds of content until the first step of the last plan for which something holds. */
  #firstAhead(holds: (step: Step) => boolean): number {
    return this.#plan.steps.reduce((first, step) => (step.ahead < first && holds(step) ? step.ahead : first), Infinity);
  }

  /** The first frame behind one at which a track begins another group. */
  #nextBorder(frame: number): number {
    let border = this.timeline.frameCount;
    for (let track = 0; track < this.head.tracks.length; track++) {
      const group = this.head.chunkOfFrame(frame, track);
      border = Math.min(border, group.shownEnd);
    }
    return border;
  }

  #checkSize(): void {
    const { size } = this.#source;
    if (size === null || size === this.#size) return;
    this.#size = size;
    if (size < this.head.size) this.decoding.cut(size);
  }
}

function timelineOf(head: Head): Timeline {
  const { frameCount, duration } = head.info;
  return new Timeline(frameCount, (frame) => (frame < frameCount ? head.timestamp(frame) : duration));
}
