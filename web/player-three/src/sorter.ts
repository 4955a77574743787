// Orders splats without keeping the page waiting: in a worker, one job at a time for each who asks; on the page where there is no worker.

import type { Box, PackedSplats } from "@meshreel/player-core/types";
import type { Vector } from "./colors.ts";
import { orderSplats } from "./order.ts";
import type { OrderJob, Ordered } from "./order.ts";

/** The part of a Worker that it needs. */
export interface OrderWorker {
  postMessage(message: OrderJob, transfer: Transferable[]): void;
  terminate(): void;
  onmessage: ((event: { data: Ordered }) => void) | null;
  onerror: ((event: never) => void) | null;
}

/** Set the splats to order; `texels` are copied. */
export interface Question {
  readonly splats: PackedSplats;
  readonly texels: Uint16Array;
  readonly box: Box;
  readonly forward: Vector;
}

interface Asker {
  answer(order: Uint32Array): void;
  splats: PackedSplats | null; // that the worker has of it
  texels: Uint16Array; // to be filled again
  isWaiting: boolean;
}

export class Sorter {
  /** ms that the last order took. */
  lastMs = 0;
  /** Called when an order has come: a picture is to be drawn. */
  onorder: (() => void) | null = null;
  #open: (() => OrderWorker) | null;
  #worker: OrderWorker | null = null;
  readonly #askers = new Map<number, Asker>();
  #keys = 0;

  /** `open`: makes a worker of order_worker.ts; null: it orders at once, on the page. */
  constructor(open: (() => OrderWorker) | null) {
    this.#open = open;
  }

  /** A key for `ask`; `answer` gets what is asked with it, or nothing where that is to be asked again. */
  join(answer: (order: Uint32Array) => void): number {
    this.#askers.set(++this.#keys, { answer, splats: null, texels: new Uint16Array(0), isWaiting: false });
    return this.#keys;
  }

  leave(key: number): void {
    this.#askers.delete(key);
  }

  /** Asks for an order; false where the last one has not come yet. */
  ask(key: number, { splats, texels, box, forward }: Question): boolean {
    const asker = this.#askers.get(key);
    if (asker === undefined || asker.isWaiting) return false;
    const worker = (this.#worker ??= this.#start());
    if (worker === null) {
      const start = performance.now();
      const order = orderSplats(splats, { texels, box, forward });
      this.#hear({ key, order, texels: asker.texels, ms: performance.now() - start });
      return true;
    }
    const copy = asker.texels.length === texels.length ? asker.texels : new Uint16Array(texels.length);
    copy.set(texels);
    const { count, words } = splats;
    const job = { key, splats: splats === asker.splats ? null : { count, words }, texels: copy, box, forward };
    asker.isWaiting = true;
    asker.splats = splats;
    worker.postMessage(job, [copy.buffer]);
    return true;
  }

  dispose(): void {
    this.#worker?.terminate();
    this.#worker = null;
    this.#askers.clear();
  }

  #start(): OrderWorker | null {
    try {
      const worker = this.#open?.() ?? null;
      if (worker !== null) {
        worker.onmessage = ({ data }) => this.#hear(data);
        worker.onerror = () => this.#giveUp();
      }
      return worker;
    } catch {
      this.#open = null;
      return null;
    }
  }

  #giveUp(): void {
    this.#worker?.terminate();
    this.#worker = this.#open = null;
    for (const asker of this.#askers.values()) {
      asker.isWaiting = false;
      asker.answer(new Uint32Array(0)); // it asks again
    }
    this.onorder?.();
  }

  #hear({ key, order, texels, ms }: Ordered): void {
    this.lastMs = ms;
    const asker = this.#askers.get(key);
    if (asker === undefined) return;
    asker.isWaiting = false;
    asker.texels = texels;
    asker.answer(order);
    this.onorder?.();
  }
}
