// Measurements of a viewer's device, as numbers that they can send.

/** The median, and what 95 % of the values do not exceed; null where there are none. */
export interface Spread {
  readonly median: number | null;
  readonly most95: number | null;
}

/** Facts that the collector cannot know itself. */
export interface BenchExtra {
  readonly gpuBytes: number; // of the recording's buffers and textures
  readonly triangles: number; // of a picture
  readonly userAgent: string;
  readonly place?: string; // place of drawing, such as "page, 1280 x 720" or "VR"
  /** Hz, where it is known. Else it follows from the shortest intervals: a display that is always too fast goes unnoticed. */
  readonly displayRate?: number;
  readonly gpu?: string;
  readonly recording?: string;
}

export interface BenchReport extends Omit<BenchExtra, "displayRate"> {
  readonly pictures: number;
  readonly seconds: number; // of the intervals between pictures
  readonly displayRate: number | null; // Hz
  readonly scriptMs: Spread; // JavaScript of the main thread, a picture
  readonly intervalMs: Spread; // from picture to picture
  readonly dropped: number; // further pictures that the display could have shown
  readonly groups: number; // decoded
  readonly decodeMs: Spread; // a group
  readonly decodeLoad: number | null; // decoding time over playing time; above 1 is too slow
  readonly seeks: number;
  readonly seekMs: Spread; // from asking for another place until its picture is at hand
}

const CAPACITY = 20_000; // 4 minutes at 90 Hz
const GROUPS = 4096;
const SEEKS = 256;

/** Collects, pictures between `frameBegin` and `frameEnd`; nothing is allocated for a picture. Times are milliseconds of one clock. */
export class Bench {
  readonly #script: Ring;
  readonly #intervals: Ring;
  readonly #decoding = new Ring(GROUPS);
  readonly #seeking = new Ring(SEEKS);
  #decodeMs = 0;
  #playedMs = 0;
  #groups = 0;
  #pictures = 0;
  #began = NaN;

  /** `capacity`: pictures that are kept, the last ones. */
  constructor(capacity = CAPACITY) {
    this.#script = new Ring(capacity);
    this.#intervals = new Ring(capacity);
  }

  frameBegin(now: number): void {
    if (!Number.isNaN(this.#began)) this.#intervals.add(now - this.#began);
    this.#began = now;
  }

  frameEnd(now: number): void {
    this.#script.add(now - this.#began);
    this.#pictures++;
  }

  /** The next picture does not follow the last one: the page was hidden, nothing was to be drawn. */
  interrupt(): void {
    this.#began = NaN;
  }

  /** Restarts the collection of pictures. What was decoded stays: a short recording is not decoded again. */
  restart(): void {
    this.#script.clear();
    this.#intervals.clear();
    this.#pictures = 0;
    this.interrupt();
  }

  /** Records the duration of a seek, ms. */
  sought(ms: number): void {
    this.#seeking.add(ms);
  }

  /** Records a decoded group: its playing time, s, and the time that decoding took, ms. */
  decoded(ms: number, seconds: number): void {
    this.#decoding.add(ms);
    this.#decodeMs += ms;
    this.#playedMs += 1000 * seconds;
    this.#groups++;
  }

  report(extra: BenchExtra): BenchReport {
    const intervals = this.#intervals.sorted();
    const seeks = this.#seeking.sorted();
    const displayRate = extra.displayRate ?? estimateRate(intervals);
    return {
      ...extra,
      pictures: this.#pictures,
      seconds: intervals.reduce((sum, interval) => sum + interval, 0) / 1000,
      displayRate,
      scriptMs: spreadOf(this.#script.sorted()),
      intervalMs: spreadOf(intervals),
      dropped: displayRate === null ? 0 : droppedOf(intervals, displayRate),
      groups: this.#groups,
      decodeMs: spreadOf(this.#decoding.sorted()),
      decodeLoad: this.#playedMs > 0 ? this.#decodeMs / this.#playedMs : null,
      seeks: seeks.length,
      seekMs: spreadOf(seeks),
    };
  }
}

/** A report as text to copy, a line a number. */
export function formatReport(report: BenchReport): string {
  const { scriptMs, intervalMs, decodeMs, seekMs } = report;
  const lines: [string, string][] = [
    ["recording", report.recording ?? "-"],
    ["place", report.place ?? "-"],
    ["display", report.displayRate === null ? "-" : `${round(report.displayRate, 1)} Hz`],
    ["pictures", `${report.pictures} in ${round(report.seconds, 1)} s, ${report.dropped} dropped`],
    ["JavaScript a picture", `${spread(scriptMs)} ms`],
    ["from picture to picture", `${spread(intervalMs)} ms`],
    ["decoding a group", `${spread(decodeMs)} ms, ${report.groups} groups`],
    ["decoding load", report.decodeLoad === null ? "-" : `${round(100 * report.decodeLoad, 1)} % of the playing time`],
    ["seek", `${spread(seekMs)} ms, ${report.seeks} seeks`],
    ["triangles", String(report.triangles)],
    ["GPU memory", `${round(report.gpuBytes / 2 ** 20, 1)} MiB`],
    ["GPU", report.gpu ?? "-"],
    ["browser", report.userAgent],
  ];
  return ["meshreel bench (median / 95 %)", ...lines.map(([name, value]) => `${name}: ${value}`)].join("\n");
}

/** The last numbers of a sequence, up to a fixed count. */
class Ring {
  readonly #values: Float64Array;
  #count = 0; // added, those that are no longer kept included

  constructor(capacity: number) {
    this.#values = new Float64Array(capacity);
  }

  add(value: number): void {
    this.#values[this.#count++ % this.#values.length] = value;
  }

  clear(): void {
    this.#count = 0;
  }

  sorted(): Float64Array {
    return this.#values.slice(0, Math.min(this.#count, this.#values.length)).sort();
  }
}

function spreadOf(sorted: Float64Array): Spread {
  return { median: quantile(sorted, 0.5), most95: quantile(sorted, 0.95) };
}

/** Between the two nearest values, by how near they are. */
function quantile(sorted: Float64Array, share: number): number | null {
  if (sorted.length === 0) return null;
  const at = share * (sorted.length - 1);
  const below = Math.floor(at);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (at - below) * (sorted[above] - sorted[below]);
}

/** A tenth of the intervals may be too short, as a browser catches up; one in ten must be as short as the display allows. */
function estimateRate(sortedIntervals: Float64Array): number | null {
  const shortest = quantile(sortedIntervals, 0.1);
  return shortest === null || shortest <= 0 ? null : 1000 / shortest;
}

/** Pictures of the display that passed without one of ours. */
function droppedOf(intervals: Float64Array, displayRate: number): number {
  let dropped = 0;
  for (const interval of intervals) dropped += Math.max(Math.round((interval * displayRate) / 1000) - 1, 0);
  return dropped;
}

function spread({ median, most95 }: Spread): string {
  return median === null || most95 === null ? "-" : `${round(median, 2)} / ${round(most95, 2)}`;
}

function round(value: number, digits: number): string {
  return value.toFixed(digits);
}
