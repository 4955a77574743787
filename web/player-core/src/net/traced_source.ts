// A file in memory whose bytes come as a network trace has it: the real network has no part in it, so that all viewers get the same.

import { Bandwidth } from "./bandwidth.ts";
import type { Transfer } from "./bandwidth.ts";
import type { Source, SourceWatch, Take } from "./source.ts";
import { rateAt } from "./trace.ts";
import type { Trace } from "./trace.ts";

const STEP = 10; // ms of the trace: bytes come once in each
const LATENCY = 40; // ms from a request until its answer begins (guess)

/** An open read; its bytes are there and wait for their time. */
interface Lane {
  readonly bytes: Uint8Array;
  readonly offset: number;
  readonly from: number; // ms, when its answer begins
  readonly take: Take;
  readonly transfer: Transfer;
  readonly settle: () => void; // resolves or rejects
  sent: number;
  answers: boolean;
}

/**
 * The trace begins with the first read. Open reads share its rate evenly; what nobody asked for is lost, as on a line. When something comes is counted in steps of
 * the trace, and a late timer catches up with all steps that it missed: bytes, and the bandwidth that is measured, do not depend on the machine.
 */
export class TracedSource implements Source {
  readonly isSelective = true;
  watch: SourceWatch | null = null;
  readonly #file: Uint8Array;
  readonly #trace: Trace;
  readonly #measured = new Bandwidth();
  #lanes: Lane[] = [];
  #began = NaN; // ms of the machine's clock
  #done = 0; // steps
  #carry = 0; // bytes, less than one for each lane
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(file: Uint8Array, trace: Trace) {
    this.#file = file;
    this.#trace = trace;
  }

  get size(): number {
    return this.#file.length;
  }
  get bandwidth(): number {
    return this.#measured.bitsPerSecond;
  }
  get latency(): number {
    return this.#measured.latency / 1000;
  }

  async read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void> {
    signal?.throwIfAborted();
    if (Number.isNaN(this.#began)) this.#began = performance.now();
    const asked = this.#now;
    const bytes = this.#file.subarray(offset, offset + length);
    if (bytes.length === 0) return;
    await new Promise<void>((resolve, reject) => {
      const end = (): void => {
        this.#lanes = this.#lanes.filter((other) => other !== lane);
        lane.transfer.end(this.#done * STEP);
        signal?.removeEventListener("abort", lane.settle);
        if (signal?.aborted) reject(signal.reason);
        else resolve();
      };
      const lane: Lane = { bytes, offset, from: asked + LATENCY, take, transfer: this.#measured.begin(asked), settle: end, sent: 0, answers: false };
      signal?.addEventListener("abort", lane.settle);
      if (this.#lanes.length === 0) this.#done = Math.max(this.#done, Math.floor(asked / STEP)); // until then nobody asked
      this.#lanes.push(lane);
      this.#wake();
    });
  }

  expect(): void {}

  close(): void {
    clearTimeout(this.#timer);
    this.#lanes = [];
  }

  get #now(): number {
    return performance.now() - this.#began;
  }

  #wake(): void {
    clearTimeout(this.#timer);
    if (this.#lanes.length > 0) this.#timer = setTimeout(() => this.#catchUp(), Math.max(0, (this.#done + 1) * STEP - this.#now));
  }

  #catchUp(): void {
    while (this.#lanes.length > 0 && (this.#done + 1) * STEP <= this.#now) this.#step();
    this.#wake();
  }

  /** Gives the bytes of one step, those that a short read leaves to the others. */
  #step(): void {
    const begins = this.#done * STEP;
    const ends = ++this.#done * STEP;
    const open = this.#lanes.filter(({ from }) => from <= begins);
    for (const lane of open.filter(({ answers }) => !answers)) {
      lane.answers = true;
      lane.transfer.answered(Math.max(lane.from, begins));
    }
    let left = this.#carry + (rateAt(this.#trace, begins / 1000) * STEP) / 1000;
    open.sort((a, b) => a.bytes.length - a.sent - (b.bytes.length - b.sent)); // the shortest first: what it leaves is for those behind it
    open.forEach((lane, k) => {
      const count = Math.min(Math.floor(left / (open.length - k)), lane.bytes.length - lane.sent);
      left -= count;
      if (count > 0 && this.#lanes.includes(lane)) this.#send(lane, count, ends);
    });
    this.#carry = open.length > 0 ? left % 1 : 0;
  }

  #send(lane: Lane, count: number, now: number): void {
    const piece = lane.bytes.slice(lane.sent, lane.sent + count);
    const at = lane.offset + lane.sent;
    lane.sent += count;
    lane.transfer.add(count, now);
    this.watch?.progress(count);
    lane.take(piece, at);
    if (lane.sent === lane.bytes.length && this.#lanes.includes(lane)) lane.settle();
  }
}
