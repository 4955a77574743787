// One open file: what of it is fetched, decoded and shown, kept in step with the play head.

import { Adaptive, PLENTY } from "./time/adaptive.ts";
import { Timeline } from "./time/clock.ts";
import { Decoding } from "./time/decoding.ts";
import type { DecodingEvents } from "./time/decoding.ts";
import { Fetcher } from "./net/fetcher.ts";
import type { When, Wish } from "./net/fetcher.ts";
import { Form } from "./format/layout.gen.ts";
import { Links, companionLayers, mostLayers, sizeWithCompanions } from "./format/links.ts";
import type { Opened } from "./net/opening.ts";
import { Picture } from "./time/picture.ts";
import type { Share } from "./time/pool.ts";
import { isVideo } from "./format/reader.ts";
import type { Chunk, Head } from "./format/reader.ts";
import { plan } from "./time/scheduler.ts";
import type { Coming, Plan, Step } from "./time/scheduler.ts";
import type { Source } from "./net/source.ts";
import { Textures } from "./time/textures.ts";
import type { Direction, Layers, Packed, Stats } from "./types.ts";

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
  readonly direction: Direction;
  readonly isBack: boolean; // time goes down
  readonly layers: Layers;
  readonly splats: boolean; // true if they are wanted
  readonly isPaused: boolean;
  readonly isWaiting: boolean; // it should play and cannot
}

export interface SessionEvents extends DecodingEvents {
  failed(error: unknown): void;
  textured(): void; // a texture came, or went
}

const BEHIND = 1; // s of content: what is decoded behind the play head is kept
const COMPRESSED = 1 << 25; // bytes of chunks kept though they are not wanted now: they may be again; files up to these are fetched whole
const MOST_WHOLE = 1 << 13; // chunks of these: all are looked through
const IDLE = 64; // wishes of idle time that are looked for at once: enough to fill some requests (guess)
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
  #plan: Plan | null = null; // the last one
  #size: number | null = null; // of the file, as the source had it last
  #speed = 1;
  #isResting = false;
  #isWhole = false; // all that may be wanted of bytes was at hand, when it was looked for last

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
    this.decoding = new Decoding(head, this.#links, this.fetcher, share, { ...events, ready: (packed, before) => this.#onReady(packed, before) });
    this.textures = new Textures(head, this.fetcher, this.decoding, { warn: events.warn, changed: events.textured }, { on: textures, decodable });
    this.picture = new Picture(head, this.decoding, this.textures);
    this.#adaptive = new Adaptive(head, this.timeline, this.decoding.wanted);
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
    const isAuto = aim.layers === "auto";
    this.#isResting = aim.isPaused || (aim.loop && this.#isDecoded);
    if (isAuto) this.#adapt(aim);
    const outlook = {
      time: aim.time,
      loop: aim.loop,
      direction: aim.direction,
      isBack: aim.isBack,
      fetchSeconds: Math.max(bufferSeconds, decodedSeconds) * aim.speed,
      decodeSeconds: decodedSeconds * aim.speed,
      behindSeconds: BEHIND,
      memory,
      layers: aim.layers === "auto" ? this.#adaptive.level : aim.layers,
      bearable: this.#isResting ? Infinity : this.#adaptive.bearable,
      isResting: this.#isResting,
      speed: aim.speed,
      exact: !isAuto,
    };
    this.textures.loop = aim.loop;
    if (aim.splats !== this.decoding.wanted.splats) this.decoding.want({ splats: aim.splats });
    const made = plan(this.head, this.#links, this.timeline, outlook, this.decoding);
    const keep = new Set(made.keep);
    this.picture.addTo(keep);
    this.#plan = made;
    this.decoding.run({ ...made, keep });
    this.decoding.release(STATICS * memory);
    const whenOf = (ahead: number): When => (ahead <= 0 ? "now" : ahead < LATER * outlook.fetchSeconds ? "soon" : "later");
    const wishesOf = (steps: readonly Step[]): Wish[] => steps.flatMap(({ chunk, fetched, ahead }) => this.#wishesOf({ chunk, layers: fetched }, whenOf(ahead)));
    const urgent = wishesOf(made.steps.filter(({ ahead }) => ahead <= 0));
    const later = wishesOf(made.steps.filter(({ ahead }) => ahead > 0));
    const more = made.more.flatMap(({ ahead, ...wanted }) => this.#wishesOf(wanted, whenOf(ahead)));
    const whole = isAuto && this.#isResting ? this.#wholeWishes(made) : [];
    const slow = this.#slowWishes(made, aim.isBack ? aim.time - outlook.fetchSeconds : aim.time, aim.isBack ? aim.time : aim.time + outlook.fetchSeconds);
    const idle = isAuto ? this.#idleWishes(made, aim, outlook.bearable, whenOf) : [];
    this.fetcher.want([...this.#pictureWishes(made, whenOf), ...urgent, ...whole, ...slow, ...later, ...more, ...idle]);
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

  /** As `readyAhead`, where time goes down. */
  readyBehind(time: number, loop: boolean, most: number): number {
    const { duration, frameCount } = this.timeline;
    let frame = this.timeline.frameAt(time);
    let sum = time - this.timeline.startOf(frame);
    while (sum < most && this.picture.isReady(frame)) {
      const first = Math.max(...this.head.tracks.map((_, track) => this.head.chunkOfFrame(frame, track).shownFirst));
      sum += this.timeline.startOf(frame) - this.timeline.startOf(first);
      if (first === 0 && (!loop || sum >= duration)) return Infinity;
      frame = first > 0 ? first - 1 : frameCount - 1;
    }
    return Math.max(0, sum);
  }

  /** True if everything that is wanted soon is decoded, however long that lasts. */
  get isSated(): boolean {
    return this.#firstAhead((step) => step.decode && !this.decoding.isSettled(step.chunk)) === Infinity;
  }

  #loadAt(layers: number): number {
    const { frameCount, duration } = this.timeline;
    const workers = Math.max(1, Math.min(this.#share.size, this.#plan?.chainCount ?? 1));
    const framesPerMs = (this.#speed * this.#movingTracks * frameCount) / (1000 * duration);
    return (this.decoding.msPerFrame(layers) * framesPerMs) / workers;
  }

  /** Statistics at a time, s. */
  statsAt(time: number, loop: boolean): SessionStats {
    const { shown, wholeLayers } = this.picture;
    const layers = Math.max(0, ...(shown?.groups ?? []).map((group) => group?.layers ?? 0));
    const { duration } = this.timeline;
    return {
      mbps: this.rateAt(layers) / 1e6,
      decodeMs: this.decoding.lastMs,
      decodeLoad: this.#loadAt(this.decoding.lastLayers),
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

  /** True if all groups are decoded, however coarse: of a short recording. */
  get #isDecoded(): boolean {
    const groups = (this.#plan?.coming ?? []).filter(({ chunk }) => chunk.kind === "group");
    return groups.length === this.head.tracks.reduce((sum, track) => sum + track.length, 0) && groups.every(({ chunk }) => this.decoding.isSettled(chunk));
  }

  /** A chunk's layers, and behind them what comes with these. */
  #wishesOf({ chunk, layers }: Pick<Step, "chunk" | "layers">, when: When): Wish[] {
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

  /** All layers of the groups at the play head, and of those that they are predicted from. */
  #wholeWishes({ coming }: Plan): Wish[] {
    return coming.filter(({ chunk, ahead }) => chunk.kind === "group" && ahead <= 0).flatMap(({ chunk }) => {
      const layers = mostLayers(chunk);
      if (this.decoding.decodedAt(chunk) >= layers || this.decoding.isFailed(chunk)) return [];
      const chain = [chunk];
      for (let before = this.#links.previousOf(chunk); before !== null && this.decoding.stateAt(before) < Math.min(layers, mostLayers(before)); ) {
        chain.unshift(before);
        before = this.#links.previousOf(before);
      }
      return chain.flatMap((other) => this.#wishesOf({ chunk: other, layers: Math.min(layers, mostLayers(other)) }, "now"));
    });
  }

  /** What is fetched where nothing else is: layer by layer of the groups that come, then, with time to rest, all others of a file which may be kept whole. */
  #idleWishes({ coming, steps }: Plan, { time, speed }: Aim, bearable: number, whenOf: (ahead: number) => When): Wish[] {
    const isAmple = (): boolean => this.#firstAhead((step) => !this.decoding.hasBytes(step), steps) > PLENTY * speed;
    if (!(this.#isResting ? this.picture.isReady(this.timeline.frameAt(time)) : isAmple())) return [];
    const near = coming.filter(({ chunk }) => chunk.kind === "group" && chunk.form !== Form.EMPTY);
    if (!this.#isResting) near.sort((a, b) => Number(this.decoding.decodedAt(a.chunk) >= 0) - Number(this.decoding.decodedAt(b.chunk) >= 0));
    const wishes: Wish[] = [];
    const add = (chunk: Chunk, layers: number, when: When): void => {
      if (wishes.length >= IDLE || this.decoding.isFailed(chunk)) return;
      wishes.push(...this.#wishesOf({ chunk, layers: Math.min(layers, mostLayers(chunk)) }, when).filter((wish) => this.fetcher.layersOf(wish.chunk) < wish.count));
    };
    for (let layers = 0; layers <= Math.min(bearable, this.head.info.mostLayers); layers++) {
      for (const { chunk, ahead } of near) add(chunk, layers, this.#isResting ? "soon" : whenOf(ahead));
    }
    if (this.#isResting && this.#isSmall) for (const chunk of this.#others(near)) add(chunk, bearable, "soon");
    this.#isWhole = wishes.length === 0;
    return wishes;
  }

  /** True if a file may be kept whole. */
  get #isSmall(): boolean {
    return this.head.chunks.length <= MOST_WHOLE && (this.rateAt(Infinity) / 8) * this.timeline.duration <= COMPRESSED;
  }

  /** Groups that are not among these, from those that follow on. */
  #others(coming: readonly Coming[]): Chunk[] {
    const near = new Set(coming.map(({ chunk }) => chunk));
    const last = coming.reduce((most, { chunk }) => Math.max(most, chunk.number), 0);
    const others = this.head.chunks.filter((chunk) => chunk.kind === "group" && chunk.form !== Form.EMPTY && !near.has(chunk));
    return [...others.filter(({ number }) => number > last), ...others.filter(({ number }) => number < last)];
  }

  /** Pictures that a group did not need with fewer layers are not waited for. */
  #onReady(packed: Packed, before: Packed | null): void {
    if (packed.kind === "group" && packed.places !== null && before?.places === null) this.textures.begin(packed.track);
    this.#events.ready(packed, before);
  }

  #adapt({ time, speed, isWaiting }: Aim): void {
    this.#adaptive.wanted = this.decoding.wanted;
    this.#adaptive.decide({
      now: performance.now(),
      time,
      speed,
      bandwidth: this.#isWhole ? 0 : this.#bandwidth,
      fetched: this.#firstAhead((step) => !this.decoding.hasBytes(step)) / speed,
      decoded: this.#firstAhead(({ decode, chunk }) => decode && !this.decoding.isSettled(chunk)) / speed,
      layers: this.decoding.lastLayers,
      loadAt: (layers) => this.#loadAt(layers),
      isWaiting,
      isResting: this.#isResting,
    });
  }

  /** A source that sends everything in any case sends nothing sooner where less is asked for. */
  get #bandwidth(): number {
    return this.#source.isSelective ? this.#source.bandwidth : 0;
  }

  /** Seconds of content until the first step of a plan, the last one if not given, for which something holds; 0 before there is one. */
  #firstAhead(holds: (step: Step) => boolean, steps = this.#plan?.steps): number {
    return steps?.reduce((first, step) => (step.ahead < first && holds(step) ? step.ahead : first), Infinity) ?? 0;
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
