// How fast bytes come, measured over the time in which something was asked for.

const SAMPLE_MS = 50; // of fetching, at least
const FIRST_MS = 20; // at least: the bytes of the first answer may all come at once
const HALF_LIVES_MS = [2000, 8000]; // of fetching

/**
 * Bits a second: the lower of a fast and a slow mean, so that a fall counts at once and a rise only when it lasts.
 *
 * Times are milliseconds of one clock. Waiting for an answer counts as fetching, as it is what a small request
 * costs; but for the first answer, before which a connection was made.
 */
export class Bandwidth {
  #open = 0;
  #since = 0; // when time was last counted, while something is open
  #busy = 0; // of the sample that is being taken, ms
  #bytes = 0;
  #isFirst = true; // nothing was measured yet
  readonly #means = HALF_LIVES_MS.map((halfLife) => ({ halfLife, sum: 0, weight: 0 }));

  begin(now: number): void {
    if (this.#open++ === 0) this.#since = now;
  }

  add(bytes: number, now: number): void {
    this.#count(now);
    if (this.#isFirst && this.#bytes === 0) this.#busy = 0;
    this.#bytes += bytes;
    if (this.#busy >= SAMPLE_MS) this.#take();
  }

  end(now: number): void {
    this.#count(now);
    if (this.#isFirst) this.#busy = Math.max(this.#busy, FIRST_MS);
    if (--this.#open === 0 && this.#bytes > 0 && this.#busy > 0) this.#take();
  }

  /** 0 before the first bytes. */
  get bitsPerSecond(): number {
    const rates = this.#means.map(({ sum, weight }) => (weight > 0 ? sum / weight : 0));
    return Math.min(...rates);
  }

  #count(now: number): void {
    if (this.#open > 0) this.#busy += Math.max(0, now - this.#since);
    this.#since = now;
  }

  #take(): void {
    const bitsPerMs = (8 * this.#bytes) / this.#busy;
    for (const mean of this.#means) {
      const kept = 0.5 ** (this.#busy / mean.halfLife);
      mean.sum = mean.sum * kept + (1 - kept) * bitsPerMs * 1000;
      mean.weight = mean.weight * kept + (1 - kept);
    }
    this.#bytes = this.#busy = 0;
    this.#isFirst = false;
  }
}
