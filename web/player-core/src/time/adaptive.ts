// Adaptation of the number of layers to the network and the processor: layers are dropped before frames are.

import type { Timeline } from "./clock.ts";
import { mostLayers, sizeWithCompanions } from "../format/links.ts";
import type { Wanted } from "../format/links.ts";
import type { Head } from "../format/reader.ts";
import { groupsBetween } from "./scheduler.ts";

/** State of playback. Seconds are of display time, layers are counted beyond the first. */
export interface Conditions {
  readonly now: number; // ms
  readonly time: number; // s of content
  readonly speed: number; // content seconds a second
  readonly bandwidth: number; // bits/s; 0 where it sets no limit
  readonly fetched: number; // s at hand from here on, as bytes; Infinity where all that is wanted is there
  readonly decoded: number; // s at hand from here on, decoded; Infinity as well
  readonly layers: number; // with which groups are decoded now
  readonly loadAt: (layers: number) => number; // decoding time over playing time; 0 where it is not known
  readonly isWaiting: boolean; // for bytes or workers, though it should play
  readonly isResting: boolean; // decoding has all the time that it takes
}

/** s at hand: enough to use nearly all of the bandwidth, and what is left for more layers (guess). */
export const PLENTY = 6;
const OUTLOOK = 10; // s of content that the rate is averaged over (guess)
const SCARCE = 1; // s at hand: the next group must come soon (guess)
const AMPLE = 2; // s at hand: enough to try one layer more (guess)
const BEARABLE = 0.8; // load that a number of layers may cause (guess)
const BEHIND = 0.9; // load from which on decoding is what comes too late (guess)
const HOLD_MS = 2000; // between a change and a rise (guess)
const PENALTY_MS = [15_000, 120_000] as const; // after decoding fell behind, first and at most, doubled each time

/**
 * How many layers are fetched before all others, `level`, and how many decoding bears, `bearable`: more are neither fetched nor decoded while it plays.
 * More than `level` are fetched where there is time, whatever the bandwidth.
 */
export class Adaptive {
  level: number;
  bearable = Infinity;
  readonly #head: Head;
  readonly #timeline: Timeline;
  #rates: readonly number[] = [];
  #ratesAt = NaN; // s
  #wanted: Wanted; // their bytes count
  #changed = -Infinity; // ms, of the level
  #bearableSince = -Infinity; // ms, of what is bearable
  #ceiling = Infinity; // layers with which decoding did not keep up, less one
  #ceilingUntil = 0; // ms
  #penalty: number = PENALTY_MS[0];

  /** Starts at best: the first layer comes first in any case, and while it comes the bandwidth is measured. */
  constructor(head: Head, timeline: Timeline, wanted: Wanted) {
    this.#head = head;
    this.#timeline = timeline;
    this.#wanted = wanted;
    this.level = this.rates(0).length - 1;
  }

  set wanted(wanted: Wanted) {
    if (wanted.textures !== this.#wanted.textures || wanted.splats !== this.#wanted.splats) this.#ratesAt = NaN;
    this.#wanted = wanted;
  }

  /** The level for the groups that are fetched next. */
  decide(conditions: Conditions): number {
    const rates = this.rates(conditions.time);
    if (!conditions.isResting) this.#bear(rates, conditions);
    const best = Math.min(rates.length - 1, this.bearable);
    const lower = Math.min(this.level, best, this.#atMost(rates, conditions));
    const higher = Math.min(best, this.#possible(rates, conditions));
    if (lower < this.level) this.#change(lower, conditions.now);
    else if (higher > this.level && conditions.now - this.#changed >= HOLD_MS) this.#change(higher, conditions.now);
    return this.level;
  }

  /** Bits a second of content at each level, over the groups that come next; recomputed where `time` is in another second. */
  rates(time: number): readonly number[] {
    const second = Math.floor(time);
    if (second !== this.#ratesAt) this.#rates = this.#ratesOf(second);
    this.#ratesAt = second;
    return this.#rates;
  }

  #ratesOf(time: number): number[] {
    const { frameCount, duration } = this.#timeline;
    const from = Math.min(time, Math.max(0, duration - OUTLOOK));
    const groups = groupsBetween(this.#head, this.#timeline.frameAt(from), this.#timeline.frameAt(from + OUTLOOK));
    const frames = groups.reduce((sum, group) => sum + group.frameCount, 0);
    const perByte = (8 * this.#head.tracks.length * frameCount) / (frames * duration);
    const most = groups.reduce((found, group) => Math.max(found, mostLayers(group)), 0);
    return Array.from({ length: most + 1 }, (_, level) => perByte * groups.reduce((sum, group) => sum + sizeWithCompanions(this.#head, group, level + 1, this.#wanted), 0));
  }

  /** What the network gives while that is little. */
  #atMost(rates: readonly number[], { bandwidth, speed, fetched, isWaiting }: Conditions): number {
    if (bandwidth === 0 || fetched >= PLENTY / 2) return Infinity;
    return affordable(rates, bandwidth / speed, isWaiting ? 0.5 : fetched < SCARCE ? 0.65 : fetched < AMPLE ? 0.85 : 0.95); // the last is above what a rise asks for
  }

  /** What the network gives for long. */
  #possible(rates: readonly number[], { bandwidth, speed, fetched, decoded }: Conditions): number {
    return decoded < AMPLE ? -1 : affordable(rates, bandwidth / speed, fetched >= PLENTY ? 0.9 : 0.7);
  }

  /** Lowers what is bearable where decoding falls behind, and tries more again where it has kept up for a while. */
  #bear(rates: readonly number[], { now, decoded, fetched, layers, loadAt, isWaiting }: Conditions): void {
    const load = loadAt(layers);
    if (load > BEHIND && (decoded < AMPLE || isWaiting) && fetched > decoded) {
      if (layers === 0 || layers > this.bearable) return; // these were begun before
      const likely = (other: number): number => loadAt(other) || (load * rates[other]) / rates[Math.min(layers, rates.length - 1)];
      this.#ceiling = this.bearable = layers - 1;
      while (this.bearable > 0 && likely(this.bearable) > BEARABLE) this.bearable--;
      this.#ceilingUntil = now + this.#penalty;
      this.#penalty = Math.min(2 * this.#penalty, PENALTY_MS[1]);
      this.#bearableSince = now;
    } else if (this.bearable < Infinity && decoded >= AMPLE && now - this.#bearableSince >= HOLD_MS) {
      const known = rates.reduce((most, _, other) => (loadAt(other) > 0 && loadAt(other) <= BEARABLE ? other : most), 0);
      const next = load > 0 && load <= BEARABLE / 2 ? this.bearable + 1 : 0;
      const more = Math.min(Math.max(known, next), now < this.#ceilingUntil ? this.#ceiling : Infinity);
      if (more <= this.bearable) return;
      this.bearable = more >= rates.length - 1 ? Infinity : more;
      this.#bearableSince = now;
    }
  }

  #change(level: number, now: number): void {
    this.level = level;
    this.#changed = now;
  }
}

/** The highest level whose rate is within a share of what there is; the lowest where none is, the best where nothing is a limit. */
function affordable(rates: readonly number[], bandwidth: number, share: number): number {
  if (!(bandwidth > 0)) return rates.length - 1;
  return Math.max(0, rates.filter((rate) => rate <= share * bandwidth).length - 1); // they never fall
}
