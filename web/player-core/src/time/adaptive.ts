// Adaptation of the number of layers to the network and the processor: layers are dropped before frames are.

import type { Timeline } from "./clock.ts";
import { mostLayers, sizeWithCompanions } from "../format/links.ts";
import type { Wanted } from "../format/links.ts";
import type { Head } from "../format/reader.ts";
import { groupsBetween } from "./scheduler.ts";

/** State of playback. Seconds are of display time. */
export interface Conditions {
  readonly now: number; // ms
  readonly time: number; // s of content
  readonly speed: number; // content seconds a second
  readonly bandwidth: number; // bits/s; 0 where it sets no limit
  readonly fetched: number; // s at hand from here on, as bytes; Infinity where all that is wanted is there
  readonly decoded: number; // s at hand from here on, decoded; Infinity as well
  readonly load: number; // decoding time over playing time; 0 where it is not known
  readonly isWaiting: boolean; // for bytes or workers, though it should play
}

const OUTLOOK = 10; // s of content that the rate is averaged over (guess)
const SCARCE = 1; // s at hand: the next group must come soon (guess)
const AMPLE = 2; // s at hand: enough to try one layer more (guess)
const PLENTY = 6; // s at hand: enough to use nearly all of the bandwidth (guess)
const BEARABLE = 0.8; // load that a number of layers may cause (guess)
const HOLD_MS = 2000; // between a change and a rise (guess)
const PROBE_MS = 8000; // with plenty at hand, until one layer more is tried than was measured to come in time: what is idle is not measured (guess)
const PROBE = 1.5; // of the bandwidth measured: what that may take (guess)
const PENALTY_MS = [15_000, 120_000] as const; // after decoding fell behind, or what was tried did, first and at most, doubled each time

export class Adaptive {
  level: number;
  readonly #head: Head;
  readonly #timeline: Timeline;
  #rates: readonly number[] = [];
  #ratesAt = NaN; // s
  #wanted: Wanted; // their bytes count
  readonly #loads: number[] = []; // of each level at normal speed, as measured last
  #changed = -Infinity; // ms
  #probed = Infinity; // level that was tried
  #ceiling = Infinity; // level that decoding or the network did not keep up with, less one
  #ceilingUntil = 0; // ms
  #penalty: number = PENALTY_MS[0];

  /** Starts with what the bandwidth measured so far allows; at best where there is none. */
  constructor(head: Head, timeline: Timeline, bandwidth: number, wanted: Wanted) {
    this.#head = head;
    this.#timeline = timeline;
    this.#wanted = wanted;
    this.level = affordable(this.rates(0), bandwidth, 0.6);
  }

  set wanted(wanted: Wanted) {
    if (wanted.textures !== this.#wanted.textures || wanted.splats !== this.#wanted.splats) this.#ratesAt = NaN;
    this.#wanted = wanted;
  }

  /** The level for the groups that are fetched next. */
  decide(conditions: Conditions): number {
    const rates = this.rates(conditions.time);
    const network = this.#forNetwork(rates, conditions);
    if (network < this.level && this.level >= this.#probed) this.#refuse(conditions.now);
    const lower = Math.min(this.level, network, this.#forDecoding(rates, conditions));
    const higher = this.#possible(rates, conditions);
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

  #forNetwork(rates: readonly number[], { bandwidth, speed, fetched, isWaiting }: Conditions): number {
    if (bandwidth === 0 || fetched >= PLENTY / 2) return Infinity;
    return affordable(rates, bandwidth / speed, isWaiting ? 0.5 : fetched < SCARCE ? 0.65 : fetched < AMPLE ? 0.85 : 0.95); // the last is above what a rise asks for
  }

  #forDecoding(rates: readonly number[], { now, speed, load, decoded, fetched, isWaiting }: Conditions): number {
    if (load > 0) this.#loads[this.level] = load / speed;
    if (load <= 0.9 || (decoded >= AMPLE && !isWaiting) || fetched <= decoded) return Infinity;
    if (this.level === 0) return 0;
    this.#refuse(now);
    let level = this.level - 1;
    const loadAt = (other: number): number => speed * (this.#loads[other] ?? ((load / speed) * rates[other]) / rates[this.level]);
    while (level > 0 && loadAt(level) > BEARABLE) level--;
    return level;
  }

  #possible(rates: readonly number[], { now, bandwidth, speed, fetched, decoded, load }: Conditions): number {
    if (decoded < AMPLE) return -1;
    const share = fetched >= PLENTY ? 0.9 : 0.7;
    const ceiling = now < this.#ceilingUntil ? this.#ceiling : Infinity;
    const known = affordable(rates, bandwidth / speed, share);
    const isProbe = known <= this.level && fetched >= PLENTY && now - this.#changed >= PROBE_MS && rates[this.level + 1] <= (PROBE * bandwidth) / speed;
    const level = Math.min(isProbe ? this.level + 1 : known, rates.length - 1, this.#bearable(load, speed), ceiling);
    if (level > this.level) this.#probed = isProbe ? level : Infinity;
    return level;
  }

  /** This level is too much, for a while. */
  #refuse(now: number): void {
    this.#ceiling = this.level - 1;
    this.#ceilingUntil = now + this.#penalty;
    this.#penalty = Math.min(2 * this.#penalty, PENALTY_MS[1]);
  }

  /** The highest level that is known to decode in time; or the next one, where this one leaves half of the time. */
  #bearable(load: number, speed: number): number {
    if (load === 0) return this.level;
    const known = this.#loads.reduce((best, other, level) => (speed * other <= BEARABLE ? level : best), 0);
    return Math.max(known, load <= BEARABLE / 2 ? this.level + 1 : 0);
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
