// Orders splats without keeping the page waiting: in a worker, one job at a time for each who asks.

import type { Box, PackedSplats } from "@meshreel/player-core/types";
import type { Vector } from "./colors.ts";
import { orderSplats } from "./order.ts";
import type { OrderJob, Ordered } from "./order.ts";

/** What it needs of a Worker. */
export interface OrderWorker {
  postMessage(message: OrderJob, transfer: Transferable[]): void;
  terminate(): void;
  onmessage: ((event: { data: Ordered }) => void) | null;
}

/** What is to be ordered; `texels` are copied. */
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
  readonly #open: (() => OrderWorker) | null;
  #worker: OrderWorker | null = null;
  readonly #askers = new Map<number, Asker>();
  #keys = 0;

  /** `open`: makes a worker of order_worker.ts; null: it orders at once, on the page. */
  constructor(open: (() => OrderWorker) | null) {
    this.#open = open;
  }

  /** A key for `ask`; `answer` gets what is asked with it. */
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
    if (this.#open === null) {
      asker.answer(orderSplats(splats, { texels, box, forward }));
      this.onorder?.();
      return true;
    }
    if (this.#worker === null) (this.#worker = this.#open()).onmessage = ({ data }) => this.#hear(data);
    const copy = asker.texels.length === texels.length ? asker.texels : new Uint16Array(texels.length);
    copy.set(texels);
    const { count, words } = splats;
    const job = { key, splats: splats === asker.splats ? null : { count, words }, texels: copy, box, forward };
    asker.isWaiting = true;
    asker.splats = splats;
    this.#worker.postMessage(job, [copy.buffer]);
    return true;
  }

  dispose(): void {
    this.#worker?.terminate();
    this.#worker = null;
    this.#askers.clear();
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
