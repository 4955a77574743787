// What a `Worker` loads.

import { serve } from "./worker.ts";
import type { Scope } from "./worker.ts";

serve(globalThis as unknown as Scope);
