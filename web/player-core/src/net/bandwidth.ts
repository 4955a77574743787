// Bandwidth, measured while bytes are on their way, and the server's response time.

const SAMPLE_MS = 50; // of bytes coming, at least
const LEAST_MS = 20; // that bytes which come at once are taken to have been under way: a busy page finds whole answers waiting (guess)
const HALF_LIVES_MS = [2000, 8000]; // of bytes coming
const DRIFT = 1 / 32; // of what an answer took longer than the quickest lately: the others may have waited behind bytes (guess)

/** One request, from asking to its end. Times are milliseconds of one clock. */
export interface Transfer {
  answered(now: number): void; // its first bytes are there
  add(bytes: number, now: number): void;
  end(now: number): void;
}

/**
 * Bits a second: the lower of a fast and a slow mean, so that a fall counts at once and a rise only when it lasts.
 *
 * Only time in which an answer is coming counts. Waiting for one does not: it costs nothing where enough is asked for at once, and
 * many small requests would make the line look slow.
 */
export class Bandwidth {
  /** Response time of the server, ms: the least of recent ones. 0 before the first answer. */
  latency = 0;
  #coming = 0; // answers
  #since = 0; // when time was last counted, while one is coming
  #busy = 0; // of the sample that is being taken, ms
  #bytes = 0;
  readonly #means = HALF_LIVES_MS.map((halfLife) => ({ halfLife, sum: 0, weight: 0 }));

  begin(asked: number): Transfer {
    let comes = false;
    return {
      answered: (now) => {
        comes = true;
        this.#learn(now - asked);
        this.#count(now);
        this.#coming++;
      },
      add: (bytes, now) => {
        this.#count(now);
        this.#bytes += bytes;
        if (this.#busy >= SAMPLE_MS) this.#take();
      },
      end: (now) => {
        if (!comes) return;
        comes = false;
        this.#count(now);
        if (--this.#coming === 0 && this.#bytes > 0) this.#take();
      },
    };
  }

  /** 0 before the first bytes. */
  get bitsPerSecond(): number {
    const rates = this.#means.map(({ sum, weight }) => (weight > 0 ? sum / weight : 0));
    return Math.min(...rates);
  }

  #learn(wait: number): void {
    const more = wait - this.latency;
    this.latency += this.latency > 0 && more > 0 ? DRIFT * more : more;
  }

  #count(now: number): void {
    if (this.#coming > 0) this.#busy += Math.max(0, now - this.#since);
    this.#since = now;
  }

  #take(): void {
    const time = Math.max(this.#busy, LEAST_MS);
    const bitsPerMs = (8 * this.#bytes) / time;
    for (const mean of this.#means) {
      const kept = 0.5 ** (time / mean.halfLife);
      mean.sum = mean.sum * kept + (1 - kept) * bitsPerMs * 1000;
      mean.weight = mean.weight * kept + (1 - kept);
    }
    this.#bytes = this.#busy = 0;
  }
}
