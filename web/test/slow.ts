// Tests that only `scripts/test --all` runs: they play for long in real time, start Python many times, or measure speed.

import { test } from "vitest";

/** Whether slow tests run. */
export const ALL = process.env.MESHREEL_ALL === "1";

/** A slow test. */
export const slowTest = test.runIf(ALL);
