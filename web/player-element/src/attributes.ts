// Attributes and properties: what a page writes, and what the player takes from it. Nothing here knows the DOM.

import { PLAYBACK_RATES } from "@meshreel/player-core/types";
import type { Quality } from "@meshreel/player-core/types";
import { MODES } from "@meshreel/player-three/modes";
import type { Mode } from "@meshreel/player-three/modes";

export type Theme = "auto" | "light" | "dark";

/** Attributes whose change the element must hear of. */
export const OBSERVED = [
  "src", "controls", "autoplay", "loop", "poster", "quality", "speed", "playbackrate", "interpolate", "mode", "camera",
  "stats", "background", "theme",
] as const;

/** A speed from 0.1 to 4; 1 where the text is none. */
export function parseSpeed(text: string | null): number {
  const speed = text === null || text.trim() === "" ? NaN : Number(text);
  return Number.isFinite(speed) ? Math.min(PLAYBACK_RATES.most, Math.max(PLAYBACK_RATES.least, speed)) : 1;
}

/** Layers beyond the first, or "auto" where the text is no whole number from 0. */
export function parseQuality(text: string | null): Quality {
  return text !== null && /^\s*\d+\s*$/.test(text) ? Number(text) : "auto";
}

export function parseMode(text: string | null): Mode {
  const word = text?.trim().toLowerCase() ?? "";
  if (word === "color") return "colour";
  return MODES.find((mode) => mode === word) ?? "shaded";
}

/** Interpolation is on unless it is switched off. */
export function parseInterpolate(text: string | null): boolean {
  return !["off", "false", "no", "0"].includes(text?.trim().toLowerCase() ?? "");
}

export function parseTheme(text: string | null): Theme {
  const word = text?.trim().toLowerCase() ?? "";
  return word === "light" || word === "dark" ? word : "auto";
}

/** True for an attribute that is there and does not say no; pages write `loop="false"` and mean it. */
export function parseFlag(text: string | null): boolean {
  return text !== null && text.trim().toLowerCase() !== "false";
}

/** Properties that a page may have set before the element was defined. */
export const PROPERTIES = [
  "src", "poster", "preload", "controls", "autoplay", "loop", "stats", "quality", "playbackRate", "interpolate", "mode", "theme",
  "background", "camera", "currentTime",
];
