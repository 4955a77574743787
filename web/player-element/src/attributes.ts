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

interface Rule {
  readonly accepts: (text: string) => boolean;
  readonly wanted: string; // in words
}

const isNumber = (text: string): boolean => text.trim() !== "" && Number.isFinite(Number(text));

/** Attributes that keep their value where a new one is none. Text without anything in it is as no attribute. */
const RULES: Readonly<Record<string, Rule>> = {
  camera: {
    accepts: (text) => text.split(",").length === 6 && text.split(",").every(isNumber),
    wanted: "six numbers with commas, as 0,1,3,0,1,0",
  },
  mode: { accepts: (text) => [...MODES, "color"].includes(text.toLowerCase()), wanted: MODES.join(", ") },
  quality: { accepts: (text) => /^(auto|\d+)$/i.test(text), wanted: "auto, or a whole number of layers from 0" },
};

/** What is wrong with an attribute's value, in a line; null where nothing is. */
export function complaint(name: string, text: string): string | null {
  const rule = RULES[name];
  if (!rule || text.trim() === "" || rule.accepts(text.trim())) return null;
  return `${name} "${text}" is passed over: give ${rule.wanted}`;
}

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
