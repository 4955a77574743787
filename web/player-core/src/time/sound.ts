// Sound: the audio file of a recording in an audio element, which leads the clock while it plays.
// In: the bytes of a chunk. Out: the time that the picture should have. Nothing is fetched while it is muted.

import { FormatError, SourceError } from "../errors.ts";
import { AudioFile, AudioType } from "../format/layout.gen.ts";
import { checkPayload } from "../format/payload.ts";
import { describe } from "../format/reader.ts";
import type { Chunk, Head } from "../format/reader.ts";
import { unpackAll } from "../format/records.ts";
import { readBytes } from "../net/source.ts";
import type { Source } from "../net/source.ts";

/** The part of an HTMLAudioElement that is used. */
export type Voice = Pick<
  HTMLAudioElement,
  "currentTime" | "duration" | "paused" | "playbackRate" | "volume" | "src" | "error" | "play" | "pause" | "addEventListener" | "removeAttribute"
>;

export interface SoundEvents {
  changed(): void; // it is there, or will not be
  volume(): void; // volume or muting is another
  warn(error: Error): void; // it cannot be heard
}

const PATIENCE = 500; // ms that the picture waits for sound that begins: longer, and it goes first (guess)
const FETCHING = 3000; // ms that playing waits for the file of the sound (guess)
const CLOSE = 0.02; // s within which no seek is made: it would cost more than it mends
const END = 0.05; // s before the end from which none is begun
const TYPES: Readonly<Record<number, string>> = {
  [AudioType.OGG]: "audio/ogg", [AudioType.WEBM]: "audio/webm", [AudioType.MP4]: "audio/mp4", [AudioType.ADTS]: "audio/aac", [AudioType.MPEG]: "audio/mpeg",
};

export class Sound {
  /** The audio element; null before it is there. */
  voice: Voice | null = null;
  readonly #make: (() => Voice) | null; // null: there is no audio here, as in Node
  readonly #events: SoundEvents;
  #load: (() => Promise<void>) | null = null; // null: there is nothing to fetch, or it was asked for
  #from = 0; // microseconds, of the first frame
  #start = 0; // s from the first frame to the first sample
  #end = 0; // s of sound; 0 before it is there
  #isPending = false; // it is fetched, or about to be
  #isBegun = false;
  #isStarting = false; // until it moves from #place
  #place = 0; // s of sound
  #since = NaN; // ms, since when something is waited for
  #muted = false;
  #volume = 1;

  constructor(events: SoundEvents, make?: () => Voice) {
    this.#events = events;
    this.#make = make ?? ("Audio" in globalThis ? () => new Audio() : null);
  }

  get muted(): boolean {
    return this.#muted;
  }
  set muted(muted: boolean) {
    if (muted === this.#muted) return;
    this.#muted = muted;
    if (muted) this.rest();
    else this.#fetch();
    this.#events.volume();
  }

  /** 0 to 1. */
  get volume(): number {
    return this.#volume;
  }
  set volume(volume: number) {
    if (!(volume >= 0 && volume <= 1)) throw new RangeError(`a volume of ${volume}: give a number from 0 to 1`);
    if (volume === this.#volume) return;
    this.#volume = volume;
    if (this.voice) this.voice.volume = volume;
    this.#events.volume();
  }

  /** Knows from now on where the file has what is heard. */
  open(head: Head, source: Source, signal: AbortSignal): void {
    const { audio } = head;
    const make = this.#make;
    if (audio === null || make === null) return;
    this.#from = head.header.firstTime;
    this.#load = async () => this.#open(await fileOf(audio, source, signal), make());
  }

  /** Fetches, unless it is muted: to be called when the first frame is there. */
  begin(): void {
    this.#isBegun = true;
    this.#fetch();
  }

  /** True if playback need not wait for it. */
  get isReady(): boolean {
    if (this.#muted || !this.#isPending) return true;
    if (Number.isNaN(this.#since)) this.#since = performance.now();
    return performance.now() - this.#since > FETCHING;
  }

  /**
   * Plays in step with the picture, which runs and is at `time`. Gives the time that is heard, s; NaN while sound begins, so that the picture
   * waits; null where nothing is to be heard, and the picture goes on by itself.
   */
  at(time: number, rate: number): number | null {
    const { voice } = this;
    const place = time - this.#start;
    if (voice === null || this.#muted || place < 0 || place >= this.#end) {
      this.rest();
      return null;
    }
    if (voice.playbackRate !== rate) voice.playbackRate = rate;
    if (this.#isStarting && voice.currentTime === this.#place) return performance.now() - this.#since < PATIENCE ? NaN : null;
    this.#isStarting = false;
    if (!voice.paused) return this.#start + voice.currentTime;
    this.#play(voice, place);
    return NaN;
  }

  /** Is silent, until the picture runs. */
  rest(): void {
    this.#isStarting = false;
    if (this.voice && !this.voice.paused) this.voice.pause();
  }

  close(): void {
    this.rest();
    this.#load = null;
    if (this.voice) {
      URL.revokeObjectURL(this.voice.src);
      this.voice.removeAttribute("src");
    }
    this.voice = null;
  }

  #play(voice: Voice, place: number): void {
    if (Math.abs(voice.currentTime - place) > CLOSE) voice.currentTime = place;
    this.#place = voice.currentTime;
    this.#isStarting = true;
    this.#since = performance.now();
    voice.play().catch((error: Error) => {
      if (error.name === "NotAllowedError") this.muted = true; // browsers play nothing aloud before a viewer has done something
    });
  }

  #fetch(): void {
    const load = this.#load;
    if (!this.#isBegun || this.#muted || load === null) return;
    this.#load = null;
    this.#isPending = true;
    this.#since = NaN;
    load().catch((error: unknown) => this.#fail(error));
  }

  #open({ start, type, data }: AudioFile, voice: Voice): void {
    this.#start = (start - this.#from) / 1e6;
    voice.addEventListener("loadedmetadata", () => {
      this.#end = voice.duration - END;
      this.voice = voice;
      this.#settle();
    });
    voice.addEventListener("ended", () => void (this.#end = Math.min(this.#end, voice.currentTime - END))); // of some files the length is a guess
    voice.addEventListener("error", () => this.#fail(new SourceError(`${TYPES[type]} cannot be played here: ${voice.error?.message || "unknown"}`)));
    voice.volume = this.#volume;
    voice.src = URL.createObjectURL(new Blob([data as Uint8Array<ArrayBuffer>], { type: TYPES[type] }));
  }

  #fail(error: unknown): void {
    this.close();
    this.#settle();
    if (error instanceof Error && error.name !== "AbortError") this.#events.warn(error instanceof FormatError ? error : new SourceError(`no sound: ${error.message}`, { cause: error }));
  }

  #settle(): void {
    this.#isPending = false;
    this.#events.changed();
  }
}

/** The audio file in a chunk. FormatError where it is damaged. */
async function fileOf(chunk: Chunk, source: Source, signal: AbortSignal): Promise<AudioFile> {
  const payload = await readBytes(source, chunk.offset, chunk.size, signal);
  checkPayload(describe(chunk), chunk.form, payload, chunk.layers);
  const file = unpackAll(AudioFile, payload);
  if (file.data.length === 0) throw new FormatError(`${describe(chunk)}: no bytes of audio`);
  return file;
}
