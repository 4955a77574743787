// A source whose bytes come at a rate, by timers, so that tests can turn the clock.

import { Bandwidth } from "../src/net/bandwidth.ts";
import type { Source, SourceWatch, Take } from "../src/net/source.ts";

const SLICE_MS = 10;

export class SlowSource implements Source {
  watch: SourceWatch | null = null;
  isSelective = true;
  /** Bytes a second, shared by all reads that are open. */
  bytesPerSecond: number;
  latencyMs: number;
  /** How much longer an answer may take: from 0 to 1 of the latency each. */
  delay: () => number = () => 0;
  size: number | null;
  readonly reads: { readonly offset: number; readonly length: number; sent: number; state: "open" | "done" | "cancelled" }[] = [];
  error: Error | null = null; // for the next reads
  readonly #bytes: Uint8Array;
  readonly #measured = new Bandwidth();
  #open = 0;

  constructor(bytes: Uint8Array, bytesPerSecond: number, latencyMs = 20) {
    this.#bytes = bytes;
    this.size = bytes.length;
    this.bytesPerSecond = bytesPerSecond;
    this.latencyMs = latencyMs;
  }

  get bandwidth(): number {
    return this.#measured.bitsPerSecond;
  }

  get latency(): number {
    return this.#measured.latency / 1000;
  }

  get sentBytes(): number {
    return this.reads.reduce((sum, { sent }) => sum + sent, 0);
  }

  async read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void> {
    const read: (typeof this.reads)[number] = { offset, length, sent: 0, state: "open" };
    this.reads.push(read);
    let comes = 0;
    const transfer = this.#measured.begin(performance.now());
    try {
      await after(this.latencyMs * (1 + this.delay()));
      if (this.error !== null) throw this.error;
      transfer.answered(performance.now());
      this.#open += comes = 1;
      const end = Math.min(offset + length, this.#bytes.length);
      let [at, due] = [offset, 0];
      while (at < end) {
        signal?.throwIfAborted();
        await after(SLICE_MS);
        signal?.throwIfAborted();
        due += (this.bytesPerSecond * SLICE_MS) / 1000 / this.#open;
        const piece = this.#bytes.slice(at, Math.min(end, at + Math.floor(due)));
        if (piece.length === 0) continue;
        due -= piece.length;
        read.sent += piece.length;
        transfer.add(piece.length, performance.now());
        this.watch?.progress(piece.length);
        take(piece, at);
        at += piece.length;
      }
      read.state = "done";
    } finally {
      if (read.state === "open") read.state = "cancelled";
      this.#open -= comes;
      transfer.end(performance.now());
    }
  }

  expect(): void {}

  close(): void {}
}

function after(ms: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, ms));
}
