// A player without a picture: fetches, decodes, keeps time.

import type { WorkerSetup } from "./pool.ts";
import type { Source } from "./source.ts";
import type { Info, Playback, PlaybackEvents, Shown, Stats } from "./types.ts";

export interface PlayerOptions {
  readonly source: Source; // the player's own from here on: `dispose` closes it
  readonly workers: WorkerSetup;
  readonly bufferSeconds?: number; // of bytes fetched ahead, at normal speed; 10 if not given
  readonly decodedSeconds?: number; // of groups decoded ahead, at normal speed; 3 if not given
  readonly memory?: number; // bytes that decoded groups may take; 256 MiB if not given
}

/** Events that a `Player` dispatches, with their types. */
export interface Player {
  addEventListener<K extends keyof PlaybackEvents>(
    type: K, listener: (event: PlaybackEvents[K]) => void, options?: AddEventListenerOptions | boolean,
  ): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: AddEventListenerOptions | boolean): void;
  removeEventListener<K extends keyof PlaybackEvents>(
    type: K, listener: (event: PlaybackEvents[K]) => void, options?: EventListenerOptions | boolean,
  ): void;
  removeEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: EventListenerOptions | boolean): void;
}

export class Player extends EventTarget implements Playback {
  info: Info | null = null;
  duration = 0;
  paused = true;
  ended = false;
  seeking = false;
  currentFrame = 0;
  currentTime = 0;
  loop = false;
  playbackRate = 1;
  interpolate = true;
  quality: number | "auto" = "auto";

  constructor(options: PlayerOptions) {
    super();
    void options;
  }

  get stats(): Stats {
    throw new Error("not there yet");
  }

  /** Reads the head and goes on to fetch; `play` does so by itself. Rejects with what the event `error` carries. */
  async load(): Promise<void> {
    throw new Error("not there yet");
  }

  async play(): Promise<void> {
    throw new Error("not there yet");
  }

  pause(): void {}

  step(frames: number): void {
    void frames;
  }

  update(now: number): Shown | null {
    void now;
    return null;
  }

  dispose(): void {}
}
