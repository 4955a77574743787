// An EventTarget whose listeners know the types of a playback's events, and how often it tells of bytes.

import type { PlaybackEvents } from "./types.ts";

export interface PlaybackTarget extends EventTarget {
  addEventListener<K extends keyof PlaybackEvents>(
    type: K, listener: (event: PlaybackEvents[K]) => void, options?: AddEventListenerOptions | boolean,
  ): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: AddEventListenerOptions | boolean): void;
  removeEventListener<K extends keyof PlaybackEvents>(
    type: K, listener: (event: PlaybackEvents[K]) => void, options?: EventListenerOptions | boolean,
  ): void;
  removeEventListener(type: string, listener: EventListenerOrEventListenerObject | null, options?: EventListenerOptions | boolean): void;
}

export const PlaybackTarget = EventTarget as { new (): PlaybackTarget; prototype: PlaybackTarget };

/** Counts bytes that came, and says when to tell of them. */
export class Progress {
  bytes = 0;
  #told = 0;
  #toldAt = 0; // ms

  /** True if events came since the last call; while more come, at most once every `everyMs`. */
  isNew(isFetching: boolean, everyMs: number): boolean {
    const now = performance.now();
    if (this.bytes === this.#told || (isFetching && now - this.#toldAt < everyMs)) return false;
    this.#told = this.bytes;
    this.#toldAt = now;
    return true;
  }
}
