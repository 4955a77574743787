// How long a first visitor waits on a slow line: until something is seen, and until the recording is.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { join } from "node:path";

import { expect, test } from "vitest";

import { describeInBrowser, launchBrowser } from "../../test/browser.ts";
import { openLink } from "../../test/link.ts";
import { PYTHON, hasPython, ROOT } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";

const RECORDING = join(ROOT, "conformance/v1/colored/scene.reel"); // 8 kB
const [BITS, MILLISECONDS] = [1e6, 200];

describeInBrowser("the player of meshreel play, on a cold line of 1 Mbit/s and 200 ms", () => {
  test.runIf(ALL && hasPython)("shows its first frame within 4 s", { retry: 2, timeout: 120_000 }, async () => {
    const server = spawn(PYTHON, ["-m", "meshreel", "play", RECORDING, "--no-browser", "--json"]);
    const browser = await launchBrowser();
    try {
      const [line] = (await once(server.stdout, "data")) as [Buffer];
      const { port, pathname, search } = new URL((JSON.parse(line.toString()) as { addresses: string[] }).addresses[0]);
      const link = await openLink(Number(port), BITS, MILLISECONDS);
      const page = await browser.newPage();
      await page.goto(link.origin + pathname + search, { waitUntil: "commit" });
      const shown = () => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0 && performance.now();
      const seen = (await (await page.waitForFunction(shown, undefined, { polling: 20 })).jsonValue()) as number;
      const painted = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]!.startTime);
      console.log(`first paint ${(painted / 1000).toFixed(2)} s, first frame ${(seen / 1000).toFixed(2)} s, ${link.bytes} bytes`);
      await link.close();
      expect(painted).toBeLessThan(1500);
      expect(seen).toBeLessThan(4000);
    } finally {
      await browser.close();
      server.kill();
    }
  });
});
