// Entry point of the `Worker` that orders splats: keeps the splats of each client.

import { orderSplats } from "./order.ts";
import type { OrderJob, Ordered } from "./order.ts";

const scope = globalThis as unknown as { onmessage: (event: MessageEvent<OrderJob>) => void; postMessage(message: Ordered, transfer: Transferable[]): void };
const kept = new Map<number, NonNullable<OrderJob["splats"]>>();

scope.onmessage = ({ data: job }) => {
  const start = performance.now();
  if (job.splats !== null) kept.set(job.key, job.splats);
  const order = orderSplats(kept.get(job.key)!, job);
  scope.postMessage({ key: job.key, order, texels: job.texels, ms: performance.now() - start }, [order.buffer, job.texels.buffer]);
};
