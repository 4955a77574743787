// A player without a picture: fetches, decodes, keeps time. Its events and properties are those of a media element.

import { Clock } from "./time/clock.ts";
import { SourceError } from "./errors.ts";
import { PlaybackTarget, Progress } from "./events.ts";
import { open } from "./net/opening.ts";
import { WorkerPool } from "./time/pool.ts";
import type { Share, WorkerSetup } from "./time/pool.ts";
import { Sound } from "./time/sound.ts";
import type { Voice } from "./time/sound.ts";
import { NO_STATS, Session } from "./session.ts";
import type { Limits } from "./session.ts";
import type { Source } from "./net/source.ts";
import { PLAYBACK_RATES } from "./types.ts";
import type { Direction, Info, Layers, Playback, PlaybackEvents, Shown, Stats } from "./types.ts";

export interface PlayerOptions extends Partial<Limits> {
  readonly source: Source; // the player's own from here on: `dispose` closes it
  readonly workers: WorkerSetup | WorkerPool; // a pool may be shared and is not disposed of
  readonly voice?: () => Voice; // makes what plays audio; an audio element if not given
}

const LIMITS: Limits = { bufferSeconds: 10, decodedSeconds: 3, memory: 1 << 28 };

const TICK_MS = 250; // between plans, and between events of time and progress, while it plays
const UNSEEN_MS = 1000; // without a picture: the page is hidden
const SOON_MS = 40; // from a group's arrival to the next plan while it plays: there are some more until then
const ENOUGH = [0.25, 1] as const; // s of display time that must be at hand to start, and to go on after a stall

export class Player extends PlaybackTarget implements Playback {
  readonly #source: Source;
  readonly #pool: WorkerPool;
  readonly #ownsPool: boolean;
  readonly #share: Share;
  readonly #limits: Limits;
  readonly #closed = new AbortController();
  #loading: Promise<void> | null = null;
  #session: Session | null = null;
  #clock: Clock | null = null;
  #error: Error | null = null;
  #start = 0; // s, where to begin once the head is there
  #loop = false;
  #direction: Direction = "normal";
  #rate = 1;
  #layers: Layers = "auto";
  #textures = true;
  #level = NaN; // layers beyond the first, as last reported by `layerschange`
  readonly sound: Sound;
  interpolate = true;
  splats = true;
  #paused = true;
  #ended = false;
  #seeking = false;
  #canPlay = false;
  #hasStalled = false; // since it last ran
  #isStallNew = false; // and was not reported
  #stalls = 0;
  readonly #progress = new Progress(); // of bytes from the source
  #updated = 0; // ms, when a picture was last asked for
  #plays: { resolve: () => void; reject: (error: Error) => void }[] = [];
  #waking: ReturnType<typeof setTimeout> | undefined;
  #wakesIn = Infinity; // ms, as it was set
  #ticking: ReturnType<typeof setInterval> | undefined;

  constructor({ source, workers, voice, ...limits }: PlayerOptions) {
    super();
    this.sound = new Sound({ changed: () => this.#wake(), volume: () => this.#tell("volumechange"), warn: (error) => this.#tell("warning", error) }, voice);
    this.#source = source;
    this.#limits = { ...LIMITS, ...limits };
    this.#ownsPool = !(workers instanceof WorkerPool);
    this.#pool = workers instanceof WorkerPool ? workers : new WorkerPool(workers);
    this.#share = this.#pool.open();
    this.#share.onfatal = (error) => this.#fail(error);
    source.watch = { warn: (error) => this.#tell("warning", error), progress: (bytes) => void (this.#progress.bytes += bytes) };
  }

  get info(): Info | null {
    return this.#session?.head.info ?? null;
  }

  get duration(): number {
    return this.#session?.timeline.duration ?? 0;
  }

  get paused(): boolean {
    return this.#paused;
  }

  get ended(): boolean {
    return this.#ended;
  }

  get seeking(): boolean {
    return this.#seeking;
  }

  get currentFrame(): number {
    return this.#clock?.timeline.frameAt(this.#clock.time) ?? 0;
  }
  get currentTime(): number {
    return this.#clock?.time ?? this.#start;
  }
  set currentTime(time: number) {
    if (!Number.isFinite(time)) throw new TypeError(`a time of ${time}: give seconds`);
    if (this.#clock === null) this.#start = Math.max(0, time);
    else this.#seek(this.#clock, time);
  }

  get loop(): boolean {
    return this.#loop;
  }
  set loop(loop: boolean) {
    this.#loop = loop;
    if (this.#clock) this.#clock.loop = loop;
    this.#wake();
  }

  get direction(): Direction {
    return this.#direction;
  }
  set direction(direction: Direction) {
    this.#direction = direction;
    if (this.#clock) this.#clock.direction = direction;
    this.#wake();
  }

  get playbackRate(): number {
    return this.#rate;
  }

  set playbackRate(rate: number) {
    const { least, most } = PLAYBACK_RATES;
    if (!Number.isFinite(rate)) throw new TypeError(`a playback rate of ${rate}: give a number from ${least} to ${most}`);
    this.#rate = Math.min(most, Math.max(least, rate));
    if (this.#clock) this.#clock.rate = this.#rate;
    this.dispatchEvent(new Event("ratechange"));
    this.#wake();
  }

  get layers(): Layers {
    return this.#layers;
  }

  set layers(layers: Layers) {
    if (layers !== "auto" && !(layers >= 0)) throw new TypeError(`layers ${layers}: give "auto" or a number from 0`);
    if (layers === this.#layers) return;
    this.#layers = layers === "auto" ? layers : Math.floor(layers);
    this.#session?.decoding.forgive(); // damaged chunks may have complete layers before the damage
    this.#wake();
  }

  get textures(): boolean {
    return this.#textures;
  }

  set textures(on: boolean) {
    this.#textures = on;
    if (this.#session) this.#session.textures.on = on;
  }

  get stats(): Stats {
    const found = this.#session?.statsAt(this.currentTime, this.#loop) ?? NO_STATS;
    return { ...found, bandwidthMbps: this.#source.bandwidth / 1e6, fetchedBytes: this.#progress.bytes, stalls: this.#stalls };
  }

  /** Reads the head and goes on to fetch; `play` does so by itself. Rejects with what the event `error` carries. */
  load(): Promise<void> {
    return (this.#loading ??= this.#open());
  }

  async play(): Promise<void> {
    if (this.#error !== null) throw this.#error;
    this.load().catch(() => {}); // reported by the event, and by the promise below
    if (this.#clock && (this.#ended || this.#clock.isAtEnd)) this.#seek(this.#clock, this.#clock.begin());
    if (this.#paused) {
      this.#paused = false;
      this.#ticking = setInterval(() => this.#tick(), TICK_MS);
      this.#tell("play");
    }
    if (this.#clock?.isRunning) return;
    if (!this.#session?.picture.canShow(this.currentFrame)) this.#tell("waiting");
    this.#wake();
    return new Promise((resolve, reject) => this.#plays.push({ resolve, reject }));
  }

  pause(): void {
    if (this.#paused) return;
    this.#rest(new DOMException("paused before it played", "AbortError"));
    this.#tell("timeupdate");
    this.#tell("pause");
  }

  step(frames: number): void {
    this.pause();
    if (this.#clock === null) return;
    const { timeline } = this.#clock;
    const frame = Math.min(Math.max(this.currentFrame + Math.trunc(frames), 0), timeline.frameCount - 1);
    this.#seek(this.#clock, timeline.startOf(frame));
  }

  update(now: number, far?: ReadonlySet<number>): Shown | null {
    const [session, clock] = [this.#session, this.#clock];
    if (session === null || clock === null) return null;
    const { picture, timeline } = session;
    if (far) session.textures.far = far;
    if (this.splats !== session.decoding.wanted.splats) this.#wake();
    this.#updated = performance.now();
    clock.advance(now);
    const frame = timeline.frameAt(clock.time);
    session.textures.isBack = clock.isBack;
    session.textures.turns = clock.direction === "alternate";
    const isShown = picture.show(frame, this.interpolate ? timeline.blendAt(clock.time, frame) : 0);
    if (clock.isRunning && !isShown) {
      if (picture.isReady(frame) && clock.direction === "normal") session.textures.late(now); // at a turn, and backwards, they are waited for
      clock.hold();
      this.#hasStalled = this.#isStallNew = true;
      this.#wake();
    } else if (clock.isRunning && clock.isAtEnd) {
      clock.stop();
      this.#wake();
    }
    return picture.shown;
  }

  dispose(): void {
    if (this.#closed.signal.aborted) return;
    this.#closed.abort();
    this.#rest(new DOMException("the player was disposed of", "AbortError"));
    clearTimeout(this.#waking);
    this.#source.watch = null;
    this.#source.close();
    this.#session?.close();
    this.sound.close();
    this.#session = this.#clock = null;
    this.#share.close();
    if (this.#ownsPool) this.#pool.dispose();
  }

  async #open(): Promise<void> {
    try {
      const opened = await open(this.#source, this.#closed.signal);
      this.#session = new Session(opened, this.#source, this.#share, this.#limits, {
        ready: (packed) => this.#tell("ready", packed),
        release: (packed) => this.#tell("release", packed),
        warn: (error) => this.#tell("warning", error),
        changed: () => this.#wake(this.#clock?.isRunning ? SOON_MS : 0),
        failed: (error) => this.#fail(error),
        textured: () => this.#onTexture(),
      }, this.#textures);
      this.#clock = new Clock(this.#session.timeline);
      this.#clock.lead = this.sound;
      this.sound.open(opened.head, this.#source, this.#closed.signal);
      this.#clock.rate = this.#rate;
      this.#clock.loop = this.#loop;
      this.#clock.direction = this.#direction;
      this.#clock.time = this.#session.timeline.clamp(this.#start);
      if (this.#clock.isBack && this.#start === 0) this.#clock.time = this.#clock.begin();
      this.#tell("loadedmetadata");
      this.#wake();
    } catch (error) {
      this.#fail(error);
      if (this.#error !== null) throw this.#error; // else it was disposed of, and the promise has no reader
    }
  }

  #seek(clock: Clock, time: number): void {
    clock.time = clock.timeline.clamp(time);
    clock.stop();
    this.#ended = this.#hasStalled = this.#isStallNew = false;
    this.#seeking = true;
    this.#tell("seeking");
    this.#wake();
  }

  /** Has it look after everything, soon: never within `update`, and once for all that happens until then. */
  #wake(delay = 0): void {
    if (this.#closed.signal.aborted || this.#wakesIn <= delay) return;
    clearTimeout(this.#waking);
    this.#wakesIn = delay;
    this.#waking = setTimeout(() => this.#tick(), delay);
  }

  #tick(): void {
    clearTimeout(this.#waking);
    this.#wakesIn = Infinity;
    const [session, clock] = [this.#session, this.#clock];
    if (session === null || clock === null || this.#error !== null) return;
    session.pump({ time: clock.time, speed: this.#rate, loop: this.#loop, direction: this.#direction, isBack: clock.isBack, layers: this.#layers, splats: this.splats, isPaused: this.#paused, isWaiting: this.#hasStalled && !clock.isRunning });
    if (this.#progress.isNew(session.fetcher.isFetching, TICK_MS)) this.#tell("progress");
    if (performance.now() - this.#updated > UNSEEN_MS) this.sound.rest(); // time stands still while nothing is displayed
    const level = this.#layers === "auto" ? session.level : this.#layers;
    if (level !== this.#level) {
      this.#level = level;
      this.#tell("layerschange");
    }
    if (this.#isStallNew) {
      this.#isStallNew = false;
      this.#stalls++;
      this.#tell("waiting");
    }
    if (session.picture.canShow(this.currentFrame)) this.#goOn(session, clock);
    if (clock.isAtEnd && !this.#paused && !this.#seeking) this.#end();
    else if (clock.isRunning) this.#tell("timeupdate");
  }

  /** The frame at the play head is at hand: report it, and play where enough follows. */
  #goOn(session: Session, clock: Clock): void {
    if (!this.#canPlay) {
      this.#canPlay = true;
      this.sound.begin();
      this.#tell("canplay");
    }
    if (this.#seeking) {
      this.#seeking = false;
      this.#tell("timeupdate");
      this.#tell("seeked");
    }
    if (this.#paused || clock.isRunning || clock.isAtEnd) return;
    const enough = ENOUGH[this.#hasStalled ? 1 : 0] * this.#rate;
    const ready = (): number => (clock.isBack ? session.readyBehind(clock.time, this.#loop, enough) : session.readyAhead(clock.time, this.#loop, enough));
    if (!this.sound.isReady || (!session.isSated && ready() < enough)) return;
    clock.start();
    this.#hasStalled = false;
    this.#tell("playing");
    for (const { resolve } of this.#plays.splice(0)) resolve();
  }

  #end(): void {
    this.#ended = true;
    this.#rest(new DOMException("it ended before it played", "AbortError"));
    this.#tell("timeupdate");
    this.#tell("pause");
    this.#tell("ended");
  }

  /** Stands still; promises of `play` that still wait are broken. */
  #rest(error: Error): void {
    this.#paused = true;
    this.#clock?.stop();
    clearInterval(this.#ticking);
    for (const { reject } of this.#plays.splice(0)) reject(error);
  }

  #fail(reason: unknown): void {
    if (this.#error !== null || this.#closed.signal.aborted) return;
    this.#error = reason instanceof Error ? reason : new SourceError(String(reason));
    const wasPaused = this.#paused;
    this.#rest(this.#error);
    this.#session?.stop();
    this.#source.close(); // else a server that ignores ranges sends on, into memory
    if (!wasPaused) this.#tell("pause");
    this.#tell("error", this.#error);
  }

  #onTexture(): void {
    if (this.#clock?.isRunning) return; // it is looked for with each picture
    this.#tell("texturechange");
    this.#wake();
  }

  #tell(type: keyof PlaybackEvents, detail?: unknown): void {
    if (this.#closed.signal.aborted && type !== "release") return;
    this.dispatchEvent(detail === undefined ? new Event(type) : new CustomEvent(type, { detail }));
  }
}
