// Events.

import type { PlaybackEvents } from "@meshreel/player-core/types";

/** Those of the playback that the element passes on; `ready` and `release` stay inside. */
export const PASSED: readonly (keyof PlaybackEvents)[] = [
  "loadedmetadata", "canplay", "play", "playing", "pause", "waiting", "seeking", "seeked", "timeupdate", "progress", "ended",
  "ratechange", "volumechange", "layerschange", "texturechange", "warning", "error",
];
