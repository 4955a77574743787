// Rules that the records of a head obey beyond their layout; breaking one throws FormatError. Beside format/checks.py.

import { FormatError } from "../errors.ts";
import { ChunkKind, Form, LARGEST, LIMITS, MOST_CHANGES, MOST_NESTED, MOST_TRACKS, SMALLEST } from "./layout.gen.ts";
import type { Header, Index, IndexEntry } from "./layout.gen.ts";

/** Kinds of chunks that belong to a group or a background, with their forms. */
const COMPANIONS: ReadonlyMap<number, number> = new Map([
  [ChunkKind.COLORS, Form.VERTEX_COLORS],
  [ChunkKind.ATLAS, Form.PLACES],
  [ChunkKind.PICTURES, Form.VIDEO],
  [ChunkKind.COMPATIBLE, Form.VIDEO],
  [ChunkKind.SPLATS, Form.GAUSSIANS],
]);
const FORMS: readonly number[] = [Form.LAPLACIAN, Form.LAYERS, Form.DRACO, Form.EMPTY, Form.PATCH];

function require(holds: boolean, message: string): void {
  if (!holds) throw new FormatError(message);
}

/** Positive rate and scale, corners in order, an interval of time between each two frames or none. */
export function checkHeader(header: Header, frameCount: number): void {
  for (const name of ["frameRate", "scale"] as const) {
    const value = header[name];
    require(value >= SMALLEST && value <= LARGEST, `Header.${name}: ${value} is not within ${SMALLEST} .. ${LARGEST}`);
  }
  for (const name of ["origin", "minimum", "maximum"] as const) {
    require(header[name].every((value) => Math.abs(value) <= LARGEST), `Header.${name}: ${header[name]} is beyond ${LARGEST}`);
  }
  const ordered = header.minimum.every((low, k) => low <= header.maximum[k]);
  require(ordered, `Header.minimum: ${header.minimum} is above maximum ${header.maximum}`);
  const intervals = header.intervals;
  require(intervals.length === 0 || intervals.length === frameCount - 1, `Header.intervals: ${intervals.length} for ${frameCount} frames`);
  require(!intervals.includes(0), "Header.intervals: one is 0, two frames at the same time");
  const last = intervals.reduce((time, interval) => time + interval, header.firstTime);
  require(last <= Number.MAX_SAFE_INTEGER, `Header.firstTime: times ${header.firstTime} to ${last} are beyond 53 bits`);
}

/** Strings, brackets and numbers of JSON. */
const TOKENS = /"(?:[^"\\]|\\.)*"|[[\]{}]|-?\d[^\s,\]}]*/g;

/** The JSON object of a header. FormatError for other text, for numbers beyond doubles, and for half a surrogate, as in Python. */
export function metadataOf(text: string): Record<string, unknown> {
  let value: unknown = null;
  let depth = 0;
  try {
    for (const token of text.match(TOKENS) ?? []) {
      depth += "[{".includes(token) ? 1 : "]}".includes(token) ? -1 : 0;
      const part: unknown = "[]{}".includes(token) ? depth : JSON.parse(token);
      if (depth > MOST_NESTED || part === Infinity || part === -Infinity || /\p{Surrogate}/u.test(String(part))) throw new SyntaxError(token);
    }
    value = JSON.parse(text);
  } catch {
    throw new FormatError(`Header.metadata: not JSON: ${text.slice(0, 40)}`);
  }
  require(typeof value === "object" && value !== null && !Array.isArray(value), "Header.metadata: not a JSON object");
  return value as Record<string, unknown>;
}

/** The laws of an index. FormatError, naming the chunk, where an entry breaks one. */
export function checkIndex(index: Index): void {
  const checks = new IndexChecks();
  for (const entry of index.chunks) checks.add(entry);
  checks.finish();
}

interface Whole {
  readonly entry: IndexEntry;
  readonly before: number | undefined; // the group that it is predicted from
  readonly isBase: boolean; // begins with a base mesh, and may have an atlas
  readonly isBearer: boolean; // begins with a mesh of all its frames, and may have splats
}

class IndexChecks {
  private readonly frames: number[] = []; // of each track so far
  private readonly groups: number[] = []; // number of the newest group of each track
  private readonly changes = new Map<number, number>(); // for each STATIC chunk, how many patches lead to it
  private place: readonly [number, number] = [0, -1]; // first frame and track of the newest group
  private readonly whole = new Map<number, Whole>(); // each STATIC and GROUP
  private readonly companions = new Map<string, number>(); // by coded chunk and kind, the number of what belongs to it
  private readonly atlases = new Map<number, number>(); // of each group with pictures, the number of its atlas
  private hasAudio = false;
  private count = 0;

  add(entry: IndexEntry): void {
    const name = `chunk ${this.count}`;
    const isStatic = entry.kind === ChunkKind.STATIC;
    const isWhole = isStatic || entry.kind === ChunkKind.GROUP;
    require(!isWhole || isStatic === (entry.frames === 0), `${name}: of kind ${entry.kind} with ${entry.frames} frames`);
    require(!isWhole || FORMS.includes(entry.form), `${name}: of kind ${entry.kind} and form ${entry.form}`);
    require(entry.layers.length > 0 && entry.layers.every((layer) => layer.size > 0), `${name}: a chunk or a layer without bytes`);
    require(new Set(entry.dependsOn).size === entry.dependsOn.length, `${name}: depends on ${entry.dependsOn}, on one of them twice`);
    if (isStatic) this.changes.set(this.count, this.changesOf(entry, name));
    else if (isWhole) this.addGroup(entry, name);
    else if (COMPANIONS.has(entry.kind)) this.addCompanion(entry, name);
    else if (entry.kind === ChunkKind.AUDIO) this.addAudio(entry, name);
    if (isWhole) this.whole.set(this.count, this.wholeOf(entry));
    this.count += 1;
  }

  finish(): void {
    require(this.frames.length > 0, "no frames: the index names no group");
    this.frames.forEach((frames, track) => {
      require(frames === this.frames[0], `track ${track} has ${frames} frames, track 0 has ${this.frames[0]}`);
    });
  }

  /** Number of patches that lead to a STATIC chunk: 0 for a mesh, 1 + those of its base for a patch. */
  private changesOf(entry: IndexEntry, name: string): number {
    const isPatch = entry.form === Form.PATCH;
    require((isPatch || entry.form === Form.DRACO) && entry.track === 0, `${name}: a static chunk of form ${entry.form}, track ${entry.track}`);
    require(entry.dependsOn.length === (isPatch ? 1 : 0), `${name}: a static chunk of form ${entry.form} depends on ${entry.dependsOn}`);
    if (!isPatch) return 0;
    const changes = this.changes.get(entry.dependsOn[0]);
    if (changes === undefined) throw new FormatError(`${name}: a patch that depends on ${entry.dependsOn}, which is no static chunk before it`);
    require(changes < MOST_CHANGES, `${name}: patch ${changes + 1} of one background, at most ${MOST_CHANGES}`);
    return changes + 1;
  }

  private wholeOf(entry: IndexEntry): Whole {
    if (entry.kind === ChunkKind.STATIC) return { entry, before: undefined, isBase: entry.form === Form.DRACO, isBearer: false };
    const before = entry.dependsOn.find((other) => !this.changes.has(other));
    const isBase = entry.form === Form.LAYERS && before === undefined;
    return { entry, before, isBase, isBearer: isBase || entry.form === Form.LAPLACIAN };
  }

  /** Check a companion, whose first dependency is the chunk that it belongs to; its kind decides the others. */
  private addCompanion({ kind, form, frames, track, dependsOn }: IndexEntry, name: string): void {
    const [of, ...others] = dependsOn;
    const whole = this.whole.get(of);
    if (whole === undefined || this.companion(of, kind) !== undefined) throw new FormatError(`${name}: of kind ${kind}, of ${of}, which is no chunk before it, or has others`);
    const fits = form === COMPANIONS.get(kind) && frames === whole.entry.frames && track === whole.entry.track;
    require(fits, `${name}: ${frames} frames of form ${form} and track ${track}, which are not those of chunk ${of}`);
    const isNeeded = this.needed(kind, of, whole).some((numbers) => numbers.length === others.length && numbers.every((number, k) => number === others[k]));
    require(isNeeded, `${name}: of kind ${kind}, of ${of}, that depends on ${others}`);
    this.companions.set(`${of} ${kind}`, this.count);
    if (form === Form.VIDEO) this.atlases.set(of, others[0]);
  }

  /** Allowed dependencies of a companion, beside the chunk that it belongs to. */
  private needed(kind: number, of: number, { before, isBase, isBearer }: Whole): readonly (readonly number[])[] {
    const last = before === undefined ? undefined : this.companion(before, kind);
    if (kind === ChunkKind.COLORS) return last === undefined ? [[]] : [[], [last]];
    if (kind === ChunkKind.ATLAS) return isBase ? [[]] : [];
    if (kind === ChunkKind.SPLATS) return isBearer ? [[]] : [];
    const own = this.companion(of, ChunkKind.ATLAS);
    if (own !== undefined) return [[own]];
    return last === undefined ? [] : [[this.atlases.get(before!)!, last]];
  }

  private companion(of: number, kind: number): number | undefined {
    return this.companions.get(`${of} ${kind}`);
  }

  private addAudio({ form, frames, track, dependsOn, layers }: IndexEntry, name: string): void {
    const isAlone = !this.hasAudio && form === Form.AUDIO_FILE && frames === 0 && track === 0 && dependsOn.length === 0;
    require(isAlone, `${name}: audio besides other audio, or not on its own`);
    const size = layers.reduce((sum, layer) => sum + layer.size, 0);
    require(size <= LIMITS.audio, `${name}: ${size} bytes of audio, over ${LIMITS.audio}`);
    this.hasAudio = true;
  }

  private addGroup(entry: IndexEntry, name: string): void {
    const track = entry.track;
    require(entry.form !== Form.PATCH, `${name}: a group of form PATCH`);
    require(track <= this.frames.length && track < MOST_TRACKS, `${name}: track ${track} after ${this.frames.length}, at most ${MOST_TRACKS}`);
    const begun = track < this.frames.length;
    const first = begun ? this.frames[track] : 0;
    const follows = first > this.place[0] || (first === this.place[0] && track > this.place[1]);
    require(follows, `${name}: track ${track} from frame ${first}; groups are in order of first frame and track`);
    const others = entry.dependsOn.filter((other) => !this.changes.has(other));
    const isNext = others.length === 0 || (begun && others.length === 1 && others[0] === this.groups[track]);
    require(isNext, `${name}: depends on ${others}, neither a static chunk before it nor the last group of its track`);
    require(entry.dependsOn.length - others.length <= 1, `${name}: depends on ${entry.dependsOn}, on several static chunks`);
    this.frames[track] = first + entry.frames;
    this.groups[track] = this.count;
    this.place = [first, track];
  }
}
