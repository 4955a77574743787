// Attributes and properties: what a page writes, and what the player takes from it. Nothing here knows the DOM.

import { DIRECTIONS, PLAYBACK_RATES } from "@meshreel/player-core/types";
import type { Direction, Layers } from "@meshreel/player-core/types";
import { MODES, shownMode } from "@meshreel/player-three/modes";
import type { Looks, Mode } from "@meshreel/player-three/modes";
import type { Up } from "@meshreel/player-three/upright";

export type Theme = "auto" | "light" | "dark";

/** Attributes whose change the element must hear of. */
export const OBSERVED = [
  "src", "controls", "autoplay", "loop", "direction", "poster", "layers", "speed", "playbackrate", "interpolate", "mode", "camera",
  "up", "stats", "background", "theme", "textures", "ground", "exposure",
  "autorotate", "fly", "section", "frames", "share", "muted", "volume", "playsinline", "crossorigin", "usdz", "glb",
] as const;

/** Value of an attribute's text, "" meaning none; null if the text is no valid value. */
type Reader<T> = (text: string) => T | null;

const words = <T extends string>(...known: readonly T[]): Reader<T> =>
  (text) => known.find((word) => word === text.trim().toLowerCase()) ?? null;

const readNumber: Reader<number> = (text) => (text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : null);

const readLayers: Reader<Layers> = (text) => (/^\s*\d+\s*$/.test(text) ? Number(text) : words("auto")(text));

const readMode: Reader<Mode> = (text) => (words("colour")(text) ? "color" : words(...MODES)(text));

const readDirection = words(...DIRECTIONS);

const readTheme = words<Theme>("auto", "light", "dark");

const readUp = words<Up>("y", "z", "-y", "-z");

/** Position and target of the camera: x, y, z each, m. */
export const readCamera: Reader<readonly number[]> = (text) => {
  const values = text.split(",").map(readNumber);
  return values.length === 6 && values.every((value) => value !== null) ? values : null;
};

/** From and to, s. */
export const readSection: Reader<readonly [number, number]> = (text) => {
  const [from, to, ...rest] = text.split(",").map(readNumber);
  return typeof from === "number" && typeof to === "number" && rest.length === 0 && from >= 0 && to > from ? [from, to] : null;
};

const readExposure: Reader<number> = (text) => {
  const exposure = readNumber(text);
  return exposure !== null && exposure >= 0 ? exposure : null;
};

const readVolume: Reader<number> = (text) => {
  const volume = readNumber(text);
  return volume !== null && volume >= 0 && volume <= 1 ? volume : null;
};

const readSwitch: Reader<boolean> = (text) => {
  const word = words("on", "true", "yes", "1", "off", "false", "no", "0")(text);
  return word === null ? null : ["on", "true", "yes", "1"].includes(word);
};

/** Attributes that keep their value where a new one is none. Text without anything in it is as no attribute. */
const RULES: Readonly<Record<string, { read: Reader<unknown>; wanted: string }>> = {
  camera: { read: readCamera, wanted: "six numbers with commas, as 0,1,3,0,1,0" },
  direction: { read: readDirection, wanted: DIRECTIONS.join(", ") },
  interpolate: { read: readSwitch, wanted: "on, or off" },
  textures: { read: readSwitch, wanted: "on, or off" },
  ground: { read: readSwitch, wanted: "on, or off" },
  exposure: { read: readExposure, wanted: "a number from 0" },
  mode: { read: readMode, wanted: MODES.join(", ") },
  playbackrate: { read: readNumber, wanted: "a number" },
  layers: { read: readLayers, wanted: "auto, or a whole number of layers from 0" },
  section: { read: readSection, wanted: "where it begins and ends in seconds, as 1.5,4" },
  speed: { read: readNumber, wanted: "a number" },
  theme: { read: readTheme, wanted: "auto, light, dark" },
  up: { read: readUp, wanted: "y, z, -y, -z" },
  volume: { read: readVolume, wanted: "a number from 0 to 1" },
};

/** Message about an invalid value of an attribute, in a line; null for a valid one. */
export function complaint(name: string, text: string): string | null {
  const rule = RULES[name];
  if (!rule || text.trim() === "" || rule.read(text) !== null) return null;
  return `${name} "${text}" is ignored: give ${rule.wanted}`;
}

/** A speed from 0.1 to 4; 1 where the text is none. */
export function parseSpeed(text: string | null): number {
  return Math.min(PLAYBACK_RATES.most, Math.max(PLAYBACK_RATES.least, readNumber(text ?? "") ?? 1));
}

/** A volume from 0 to 1; 1 where the text is none. */
export function parseVolume(text: string | null): number {
  return readVolume(text ?? "") ?? 1;
}

/** Brightness of the light, 1 where the text is none. */
export function parseExposure(text: string | null): number {
  return readExposure(text ?? "") ?? 1;
}

/** Layers beyond the first, or "auto" where the text is no whole number from 0. */
export function parseLayers(text: string | null): Layers {
  return readLayers(text ?? "") ?? "auto";
}

export function parseDirection(text: string | null): Direction {
  return readDirection(text ?? "") ?? "normal";
}

/** Appearance of surfaces without an attribute: the first of splats, colours and shading that the recording has. */
export function parseMode(text: string | null, has: Looks | null): Mode {
  return shownMode(readMode(text ?? "") ?? "splats", has);
}

/** True if splats are wanted, should there be some. */
export function wantsSplats(text: string | null): boolean {
  return (readMode(text ?? "") ?? "splats") === "splats";
}

/** The axis that points up, in place of the one in the file; null where none is given. */
export function parseUp(text: string | null): Up | null {
  return readUp(text ?? "");
}

/** Of what is on unless it is switched off: interpolation, and textures. */
export function parseSwitch(text: string | null): boolean {
  return readSwitch(text ?? "") ?? true;
}

export function parseTheme(text: string | null): Theme {
  return readTheme(text ?? "") ?? "auto";
}

/** True for an attribute that is there and does not say no; pages write `loop="false"` and mean it. */
export function parseFlag(text: string | null): boolean {
  return text !== null && text.trim().toLowerCase() !== "false";
}

/** Properties that a page may have set before the element was defined. */
export const PROPERTIES = [
  "src", "poster", "preload", "controls", "autoplay", "loop", "direction", "stats", "layers", "playbackRate", "interpolate", "textures", "mode", "theme",
  "up", "background", "camera", "currentTime", "ground", "exposure", "autoRotate", "fly", "section", "frames", "share", "muted", "volume", "playsInline", "crossOrigin", "usdz", "glb",
];
