import { availableParallelism } from "node:os";
import { defineConfig } from "vitest/config";

const TIMED = "*/test/**/*.timed.test.ts"; // tests of a clock: after all others, one at a time

export default defineConfig({
  test: {
    testTimeout: 30_000,
    projects: [
      {
        extends: true,
        test: {
          name: "untimed",
          include: ["test/*.test.ts", "*/test/**/*.test.ts"],
          exclude: [TIMED],
          maxWorkers: Math.max(2, availableParallelism() - 1), // two on two cores, too: browsers' tests wait much of the time
          sequence: { groupOrder: 0 },
        },
      },
      { extends: true, test: { name: "timed", include: [TIMED], maxWorkers: 1, sequence: { groupOrder: 1 } } },
    ],
  },
});
