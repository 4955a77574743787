// An EventTarget whose listeners know the types of a playback's events.

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
