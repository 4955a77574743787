// Parameters of the page's address: ?src, ?t, ?autoplay, ?loop, ?direction, ?stats, ?mode, ?layers, ?camera, ?speed, ?theme, ?up, ?background,
// ?poster, ?interpolate, ?textures, ?ground, ?exposure, ?section, ?controls, ?autorotate, ?fly, ?frames, ?muted, ?volume, ?bench, ?study, ?participant.
// All but t, bench, study and participant are attributes of the element.

export interface Parameters {
  /** Attributes to set; null to take one away. */
  readonly attributes: ReadonlyMap<string, string | null>;
  readonly time: number; // s; 0 where none is asked for
  readonly bench: number | null; // s to measure for; null where it is not asked for
  readonly study: string; // address of a study's description; empty where none is asked for
  readonly participant: string; // of the study; empty where the viewer is to say
}

const TEXTS = ["src", "mode", "layers", "camera", "speed", "theme", "up", "background", "poster", "interpolate", "textures", "ground", "exposure", "direction", "section", "volume"];
const BENCH = 20; // s, where none are given
const FLAGS = ["autoplay", "loop", "stats", "controls", "autorotate", "fly", "frames", "muted"];

/** Reads `location.search`; what is not known is passed over. */
export function readParameters(search: string): Parameters {
  const given = new URLSearchParams(search);
  const attributes = new Map<string, string | null>();
  for (const name of TEXTS) {
    const text = given.get(name);
    if (text !== null && text !== "") attributes.set(name, text);
  }
  for (const name of FLAGS) if (given.has(name)) attributes.set(name, isOn(given.get(name)) ? "" : null);
  const bench = isOn(given.get("bench")) ? readTime(given.get("bench")) || BENCH : null;
  return { attributes, time: readTime(given.get("t")), bench, study: given.get("study") ?? "", participant: given.get("participant") ?? "" };
}

function isOn(text: string | null): boolean {
  return text !== null && !["0", "false", "off", "no"].includes(text.toLowerCase());
}

/** Seconds of "12.5" or "1:05.5"; 0 of anything else. */
export function readTime(text: string | null): number {
  if (text === null || !/^(\d+:){0,2}\d+(\.\d+)?s?$/.test(text)) return 0;
  return text.replace("s", "").split(":").reduce((seconds, part) => seconds * 60 + Number(part), 0);
}
