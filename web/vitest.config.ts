import { readFileSync } from "node:fs";
import { availableParallelism } from "node:os";
import { relative, sep } from "node:path";
import { fileURLToPath } from "node:url";
import { defineConfig } from "vitest/config";
import { BaseSequencer } from "vitest/node";
import type { TestSpecification } from "vitest/node";

const TIMED = "*/test/**/*.timed.test.ts"; // tests of a clock: after all others, one at a time, and again where something else disturbed them
// Tests in a browser that only `scripts/test --all` runs: all but those of bits, of controls and of what is drawn.
const LEFT_OUT = "*/test/**/!(conformance|element|controls|scene).browser.test.ts";
const EXCLUDED = process.env.MESHREEL_ALL === "1" ? [TIMED] : [TIMED, LEFT_OUT];
const RECORDED = new URL("../tests/durations.json", import.meta.url); // written by scripts/durations.py

/** Files that took longest run first, so that no worker waits at the end; those that are not recorded are taken for long. */
class LongestFirst extends BaseSequencer {
  override async sort(files: TestSpecification[]): Promise<TestSpecification[]> {
    const root = fileURLToPath(new URL("..", import.meta.url));
    const { files: seconds } = JSON.parse(readFileSync(RECORDED, "utf8")) as { files: Record<string, number> };
    const of = (file: TestSpecification): number => seconds[relative(root, file.moduleId).split(sep).join("/")] ?? Number.MAX_VALUE;
    return [...files].sort((a, b) => of(b) - of(a));
  }
}

export default defineConfig({
  test: {
    testTimeout: 120_000, // a test that waits ends as soon as it has what it waits for, however long a busy machine takes
    hookTimeout: 240_000,
    expect: { poll: { timeout: 30_000 } },
    sequence: { sequencer: LongestFirst },
    projects: [
      {
        extends: true,
        test: {
          name: "untimed",
          include: ["test/*.test.ts", "*/test/**/*.test.ts"],
          exclude: EXCLUDED,
          maxWorkers: Math.max(2, availableParallelism() - 1), // two on two cores, too: browsers' tests wait much of the time
          sequence: { groupOrder: 0 },
        },
      },
      { extends: true, test: { name: "timed", include: [TIMED], maxWorkers: 1, retry: 2, sequence: { groupOrder: 1 } } },
    ],
  },
});
