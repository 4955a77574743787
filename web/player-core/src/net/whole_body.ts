// A whole file that arrives as one stream, from a server that knows no ranges.

import type { Take } from "./source.ts";

/** Keeps what has arrived, and gives ranges of it as soon as they are there. */
export class WholeBody {
  readonly #pieces: Uint8Array[] = [];
  readonly #starts: number[] = [];
  #length = 0;
  #state: "arriving" | "whole" | { error: unknown } = "arriving";
  #waiting: (() => void)[] = [];

  /** Bytes that have arrived. */
  get length(): number {
    return this.#length;
  }

  add(bytes: Uint8Array): void {
    this.#pieces.push(bytes);
    this.#starts.push(this.#length);
    this.#length += bytes.length;
    this.#wake();
  }

  finish(): void {
    this.#state = "whole";
    this.#wake();
  }

  fail(error: unknown): void {
    this.#state = { error };
    this.#wake();
  }

  async read(offset: number, end: number, take: Take, signal?: AbortSignal): Promise<void> {
    let at = offset;
    for (;;) {
      signal?.throwIfAborted();
      if (at < end && at < this.#length) at = this.#give(at, end, take);
      else if (at >= end || this.#state === "whole") return;
      else if (this.#state !== "arriving") throw this.#state.error;
      else await this.#more(signal);
    }
  }

  /** Gives the rest of the piece that byte `at` is in. */
  #give(at: number, end: number, take: Take): number {
    let [low, high] = [0, this.#starts.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.#starts[middle] <= at) low = middle;
      else high = middle - 1;
    }
    const start = this.#starts[low];
    const bytes = this.#pieces[low].slice(at - start, end - start);
    take(bytes, at);
    return at + bytes.length;
  }

  #more(signal?: AbortSignal): Promise<void> {
    return new Promise((resolve) => {
      const go = (): void => {
        signal?.removeEventListener("abort", go);
        resolve();
      };
      this.#waiting.push(go);
      signal?.addEventListener("abort", go);
    });
  }

  #wake(): void {
    const waiting = this.#waiting;
    this.#waiting = [];
    for (const go of waiting) go();
  }
}
