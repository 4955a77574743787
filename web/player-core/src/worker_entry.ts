// Entry point of a decoding `Worker`.

import { serve } from "./decode/worker.ts";
import type { Scope } from "./decode/worker.ts";

serve(globalThis as unknown as Scope);
