import { fileURLToPath } from "node:url";
import { afterAll, beforeAll, expect } from "vitest";
import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import { slowTest } from "../../test/slow.ts";
import { formatReport } from "../src/bench.ts";
import type {} from "./pages/bench.ts";

const TARGET = 1; // ms
const TOLERANCE = 3; // times: the machine of a test is slow and shared

describeInBrowser("what a picture costs the main thread", () => {
  let open: OpenPage;
  beforeAll(async () => {
    open = await openPage(fileURLToPath(new URL("pages/bench.ts", import.meta.url)));
    await open.page.waitForFunction(() => window.bench !== undefined);
  }, 120_000);
  afterAll(async () => open?.close());

  slowTest("1 ms of JavaScript (three times that here, where others work too) with 50k moving and 300k still vertices", async () => {
    const { moving, still } = await open.page.evaluate(() => window.bench.vertices);
    expect(moving).toBeGreaterThanOrEqual(50_000);
    expect(still).toBeGreaterThanOrEqual(300_000);
    const report = await open.page.evaluate(() => window.bench.measure());
    console.log(formatReport(report));
    expect(report.pictures).toBe(50);
    expect(report.triangles).toBeGreaterThan(600_000);
    expect(await open.page.evaluate(() => window.bench.drawn())).toBeGreaterThan(1000);
    expect(report.scriptMs.median).toBeLessThanOrEqual(TOLERANCE * TARGET);
    expect(open.errors).toEqual([]);
  }, 120_000);
});
