// Keys: which action a key stands for, and when a key belongs to something else.

export type Action =
  | "toggle" | "back" | "forward" | "first" | "last" | "previousFrame" | "nextFrame" | "fullscreen" | "vr" | "stats"
  | "mode" | "loop" | "fit" | "help" | "close";

/** What `actionOf` looks at of a KeyboardEvent. */
export interface Key {
  readonly key: string;
  readonly ctrlKey?: boolean;
  readonly altKey?: boolean;
  readonly metaKey?: boolean;
}

/** The keys of the help overlay, in its order: names shown, values of `event.key`, action, what it does. */
export const KEYS: readonly { shown: string; keys: readonly string[]; action: Action; says: string }[] = [
  { shown: "Space, K", keys: [" ", "k"], action: "toggle", says: "Play or pause" },
  { shown: "←", keys: ["ArrowLeft"], action: "back", says: "Seek back" },
  { shown: "→", keys: ["ArrowRight"], action: "forward", says: "Seek forward" },
  { shown: "Home", keys: ["Home"], action: "first", says: "First frame" },
  { shown: "End", keys: ["End"], action: "last", says: "Last frame" },
  { shown: ",", keys: [","], action: "previousFrame", says: "Previous frame" },
  { shown: ".", keys: ["."], action: "nextFrame", says: "Next frame" },
  { shown: "L", keys: ["l"], action: "loop", says: "Loop on or off" },
  { shown: "M", keys: ["m"], action: "mode", says: "Next shading" },
  { shown: "0", keys: ["0"], action: "fit", says: "Fit the view" },
  { shown: "S", keys: ["s"], action: "stats", says: "Statistics" },
  { shown: "F", keys: ["f"], action: "fullscreen", says: "Full screen" },
  { shown: "V", keys: ["v"], action: "vr", says: "Virtual reality" },
  { shown: "?", keys: ["?"], action: "help", says: "These keys" },
];

const ACTIONS = new Map(KEYS.flatMap(({ keys, action }) => keys.map((key) => [key, action] as const)));

/** The action of a key; null for keys of the browser (with Ctrl, Alt or Meta) and for all others. */
export function actionOf(event: Key): Action | null {
  if (event.ctrlKey || event.altKey || event.metaKey) return null;
  if (event.key === "Escape") return "close";
  return ACTIONS.get(event.key.length === 1 ? event.key.toLowerCase() : event.key) ?? null;
}

/** Seconds that an arrow key seeks: a tenth of the recording, at most five seconds. */
export function seekStep(duration: number): number {
  return Math.min(5, duration / 10);
}

/** What `takesKey` looks at of an element. */
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
