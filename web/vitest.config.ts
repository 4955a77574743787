import { availableParallelism } from "node:os";
import { defineConfig } from "vitest/config";

export default defineConfig({
  test: {
    include: ["test/*.test.ts", "*/test/**/*.test.ts"],
    testTimeout: 30_000,
    maxWorkers: Math.max(2, availableParallelism() - 1), // two on two cores, too: browsers' tests wait much of the time
  },
});
