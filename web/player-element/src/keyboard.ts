// Keys: which action a key stands for, and when a key belongs to something else.

export type Action =
  | "toggle" | "back" | "forward" | "first" | "last" | "previousFrame" | "nextFrame" | "fullscreen" | "vr" | "stats"
  | "mode" | "loop" | "fit" | "help" | "close" | "turnLeft" | "turnRight" | "turnUp" | "turnDown" | "closer" | "farther"
  | "mute" | "louder" | "quieter" | "sectionFrom" | "sectionTo" | "sectionOff" | "autoRotate" | "fly" | "frames";

/** The part of a KeyboardEvent that `actionOf` reads. */
export interface Key {
  readonly key: string;
  readonly ctrlKey?: boolean;
  readonly altKey?: boolean;
  readonly metaKey?: boolean;
  readonly shiftKey?: boolean;
}

/** The keys of the help overlay, in its order: what is shown, and the action of each value of `event.key`. */
export const KEYS: readonly { shown: string; says: string; keys: Readonly<Record<string, Action>> }[] = [
  { shown: "Space, K", says: "Play or pause", keys: { " ": "toggle", k: "toggle" } },
  { shown: "← →", says: "Seek back, forward", keys: { ArrowLeft: "back", ArrowRight: "forward" } },
  { shown: "Home End", says: "First, last frame", keys: { Home: "first", End: "last" } },
  { shown: ", .", says: "Previous, next frame", keys: { ",": "previousFrame", ".": "nextFrame" } },
  { shown: "L", says: "Loop on or off", keys: { l: "loop" } },
  { shown: "U", says: "Mute or unmute", keys: { u: "mute" } },
  { shown: "↑ ↓", says: "Volume up, down", keys: { ArrowUp: "louder", ArrowDown: "quieter" } },
  { shown: "[ ]", says: "Set loop start, end", keys: { "[": "sectionFrom", "]": "sectionTo" } },
  { shown: "\\", says: "Clear loop", keys: { "\\": "sectionOff" } },
  { shown: "N", says: "Frame numbers", keys: { n: "frames" } },
  {
    shown: "Shift + arrows", says: "Rotate view",
    keys: { "Shift+ArrowLeft": "turnLeft", "Shift+ArrowRight": "turnRight", "Shift+ArrowUp": "turnUp", "Shift+ArrowDown": "turnDown" },
  },
  { shown: "+ −", says: "Zoom in, out", keys: { "+": "closer", "=": "closer", "-": "farther" } },
  { shown: "0", says: "Reset view", keys: { 0: "fit" } },
  { shown: "R", says: "Auto-rotate", keys: { r: "autoRotate" } },
  { shown: "G", says: "Fly mode: W A S D, Q E, drag, wheel", keys: { g: "fly" } },
  { shown: "M", says: "Next shading", keys: { m: "mode" } },
  { shown: "S", says: "Statistics", keys: { s: "stats" } },
  { shown: "F", says: "Full screen", keys: { f: "fullscreen" } },
  { shown: "V", says: "Enter or exit VR", keys: { v: "vr" } },
  { shown: "?", says: "Keyboard shortcuts", keys: { "?": "help" } },
];

const ACTIONS = new Map(KEYS.flatMap(({ keys }) => Object.entries(keys)));

/** The action of a key; null for keys of the browser (with Ctrl, Alt or Meta) and for all others. */
export function actionOf(event: Key): Action | null {
  if (event.ctrlKey || event.altKey || event.metaKey) return null;
  if (event.key === "Escape") return "close";
  if (event.key.length === 1) return ACTIONS.get(event.key.toLowerCase()) ?? null; // Shift is in the character already
  return ACTIONS.get(event.shiftKey ? `Shift+${event.key}` : event.key) ?? null;
}

/** True if an action is for recordings with sound; for others, its key is left to the page. */
export function isOfSound(action: Action): boolean {
  return ["mute", "louder", "quieter"].includes(action);
}

/** Seconds that an arrow key seeks: a tenth of the recording, at most five seconds. */
export function seekStep(duration: number): number {
  return Math.min(5, duration / 10);
}

/** The part of an element that `takesKey` reads. */
export interface Target {
  readonly localName?: string;
  readonly type?: string;
  readonly isContentEditable?: boolean;
}

/**
 * True where the focused element needs the key itself: a form field any key, a button its Space and Enter.
 *
 * The player's own seek bar is a range input; it leaves all keys to the player, so that arrows do the same everywhere.
 */
export function takesKey(target: Target, key: string): boolean {
  if (target.isContentEditable) return true;
  const name = target.localName ?? "";
  if (name === "input") return target.type !== "range";
  if (name === "textarea" || name === "select") return true;
  if (name === "button" || name === "a" || name === "summary") return key === " " || key === "Enter";
  return false;
}
