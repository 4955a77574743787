// The player as Python serves it: compressed, and under addresses that browsers need not ask for again.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { join } from "node:path";

import { expect, test } from "vitest";

import { describeInBrowser, launchBrowser } from "../../test/browser.ts";
import { hasPython, PYTHON, ROOT } from "../../test/python.ts";

describeInBrowser("the player of meshreel play", () => {
  test.skipIf(!hasPython)("plays, and comes from the browser's cache the second time", async () => {
    const server = spawn(PYTHON, ["-m", "meshreel", "play", join(ROOT, "conformance/v1/layers.reel"), "--no-browser", "--json"]);
    const browser = await launchBrowser();
    try {
      const [line] = (await once(server.stdout, "data")) as [Buffer];
      const address = (JSON.parse(line.toString()) as { addresses: string[] }).addresses[0];
      const page = await browser.newPage();
      const errors: string[] = [];
      page.on("pageerror", (error) => errors.push(String(error)));
      page.on("console", (message) => void (message.type() === "error" && errors.push(message.text())));
      const load = async (): Promise<PerformanceResourceTiming[]> => {
        await page.goto(address);
        await page.waitForFunction(() => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0);
        const entries = await page.evaluate(() => performance.getEntriesByType("resource").map((entry) => entry.toJSON() as PerformanceResourceTiming));
        return entries.filter((entry) => /\/player\/[0-9a-f]{24}\/[^/]*\.(js|css|wasm)$/.test(entry.name));
      };
      const [first, second] = [await load(), await load()];
      const names = first.map((entry) => entry.name.replace(/.*\//, ""));
      expect(names).toEqual(expect.arrayContaining(["page.js", "load.js", "meshreel-player.js", "three.js", "core.wasm"]));
      expect(names.filter((name) => name.endsWith(".gz"))).toEqual([]);
      for (const entry of first) expect(entry.encodedBodySize).toBeLessThan(entry.decodedBodySize);
      expect(first.every((entry) => entry.transferSize > 0)).toBe(true);
      expect(second.map((entry) => entry.transferSize)).toEqual(second.map(() => 0));
      expect(second.length).toBe(first.length);
      await page.goto(`${address}?bench=1`); // a page that has its recording before the bench begins
      const text = await page.waitForFunction(() => document.querySelector("pre")?.textContent!.split("\n").find((each) => each.startsWith("{")), undefined, { timeout: 90_000 });
      expect((JSON.parse((await text.jsonValue())!) as { groups: number }).groups).toBeGreaterThan(0);
      expect(errors).toEqual([]);
    } finally {
      await browser.close();
      server.kill();
    }
  });

  test.skipIf(!hasPython)("shows a gallery that is searched and sorted, and plays what a mouse points at", async () => {
    const server = spawn(PYTHON, ["-m", "meshreel", "serve", join(ROOT, "conformance/v1"), "--port", "0", "--json"]);
    const browser = await launchBrowser();
    try {
      const [line] = (await once(server.stdout, "data")) as [Buffer];
      const page = await browser.newPage({ viewport: { width: 1000, height: 700 } });
      const errors: string[] = [];
      page.on("pageerror", (error) => errors.push(String(error)));
      await page.goto((JSON.parse(line.toString()) as { addresses: string[] }).addresses[0]!);
      const names = (): Promise<string[]> => page.locator("li:visible .name").allTextContents();
      await page.getByLabel("Search").fill("LAY pos");
      expect(await names()).toEqual(["layers_posed"]);
      await page.getByLabel("Search").fill("lay");
      await page.getByLabel("Sort by").selectOption("size");
      expect(await names()).toEqual(["layers", "layers_open", "layers_patched", "layers_posed"]);
      await page.getByLabel("Sort by").selectOption("name");
      expect((await names()).sort()).toEqual(await names());
      await page.locator("li:visible").first().hover();
      await page.waitForFunction(() => document.querySelector<HTMLElement & { currentFrame: number; paused: boolean }>("li .preview")?.paused === false);
      await page.mouse.move(1, 1);
      await page.locator(".preview").waitFor({ state: "detached" });
      expect(errors).toEqual([]);
    } finally {
      await browser.close();
      server.kill();
    }
  });
});
