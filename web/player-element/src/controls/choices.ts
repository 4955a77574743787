// Choices of the menus.

import type { Direction, Layers } from "@meshreel/player-core/types";
import { modesOf, type Looks, type Mode } from "@meshreel/player-three/modes";
import { formatSpeed } from "../format.ts";
import type { Choice } from "./dom.ts";

const SPEEDS = [0.1, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2, 4];
const MOST_LEVELS = 6;
const MODE_NAMES: Readonly<Record<Mode, string>> = {
  splats: "Splats", color: "Colour", shaded: "Shaded", normal: "Normals", wireframe: "Wireframe", tracks: "Colour by body",
};

/** Directions of playback; viewers of 3D files call them so. */
export const DIRECTION_CHOICES: readonly (Choice & { readonly value: Direction })[] = [
  { value: "normal", text: "Forward" }, { value: "reverse", text: "Reverse" }, { value: "alternate", text: "Ping-pong" },
];

/** Usual speeds, and the one that is set if it is none of them. */
export function speedChoices(current: number): readonly Choice[] {
  const speeds = SPEEDS.includes(current) ? SPEEDS : [...SPEEDS, current].sort((a, b) => a - b);
  return speeds.map((speed) => ({ value: String(speed), text: formatSpeed(speed) }));
}

/** Auto, then numbers of layers from the highest to the lowest; of many a few, evenly spaced, and the one that is set. */
export function layersChoices(mostLayers: number, current: Layers): readonly Choice[] {
  const levels = new Set<number>();
  const count = Math.min(mostLayers + 1, MOST_LEVELS);
  for (let i = 0; i < count; i++) levels.add(Math.round((mostLayers * i) / Math.max(1, count - 1)));
  if (typeof current === "number") levels.add(Math.min(current, mostLayers));
  const descending = [...levels].sort((a, b) => b - a);
  return [{ value: "auto", text: "Auto" }, ...descending.map((level) => ({ value: String(level), text: levelName(level, mostLayers) }))];
}

/** The value of `layersChoices` for a setting. */
export function layersValue(mostLayers: number, current: Layers): string {
  return current === "auto" ? current : String(Math.min(current, mostLayers));
}

function levelName(level: number, most: number): string {
  if (level === most) return "Highest";
  return level === 0 ? "Lowest" : `${level} of ${most} layers`;
}

export function modeChoices(has: Looks | null): readonly Choice[] {
  return modesOf(has).map((mode) => ({ value: mode, text: MODE_NAMES[mode] }));
}

export function modeName(mode: Mode): string {
  return MODE_NAMES[mode];
}

export function nextMode(mode: Mode, has: Looks | null): Mode {
  const modes = modesOf(has);
  return modes[(modes.indexOf(mode) + 1) % modes.length]!;
}
