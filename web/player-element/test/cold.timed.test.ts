// How long a first visitor waits on a slow line: until something is seen, and until the recording is.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { join } from "node:path";

import type { Browser } from "playwright-core";
import { expect, test } from "vitest";

import { describeInBrowser, launchBrowser } from "../../test/browser.ts";
import { openLink } from "../../test/link.ts";
import { PYTHON, hasPython, ROOT } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";

const RECORDING = join(ROOT, "conformance/v1/colored/scene.reel"); // 8 kB
const [BITS, MILLISECONDS] = [1e6, 200];
// Of a free processor, without a line, in ms: what a busy or slower one takes beyond it is not the line's.
const OWN = { painted: 500, seen: 800 };

/** Of a page opened through a line: until the first paint and until the first frame is shown, in ms, and the bytes that came. */
async function visit(browser: Browser, address: URL, bits: number, milliseconds: number): Promise<{ painted: number; seen: number; bytes: number }> {
  const link = await openLink(Number(address.port), bits, milliseconds);
  const context = await browser.newContext(); // with a cache of its own
  try {
    const page = await context.newPage();
    await page.goto(link.origin + address.pathname + address.search, { waitUntil: "commit" });
    const shown = () => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0 && performance.now();
    const seen = (await (await page.waitForFunction(shown, undefined, { polling: 20 })).jsonValue()) as number;
    const painted = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]!.startTime);
    return { painted, seen, bytes: link.bytes };
  } finally {
    await context.close();
    await link.close();
  }
}

describeInBrowser("the player of meshreel play, on a cold line of 1 Mbit/s and 200 ms", () => {
  test.runIf(ALL && hasPython)("shows its first frame within 4 s", async () => {
    const server = spawn(PYTHON, ["-m", "meshreel", "play", RECORDING, "--no-browser", "--json"]);
    const browser = await launchBrowser();
    try {
      const [line] = (await once(server.stdout, "data")) as [Buffer];
      const address = new URL((JSON.parse(line.toString()) as { addresses: string[] }).addresses[0]);
      const slow = await visit(browser, address, BITS, MILLISECONDS); // the first that the server and the browser see
      const fast = await visit(browser, address, 1e9, 0);
      for (const [name, { painted, seen, bytes }] of Object.entries({ slow, fast }))
        console.log(`${name} line: first paint ${(painted / 1000).toFixed(2)} s, first frame ${(seen / 1000).toFixed(2)} s, ${bytes} bytes`);
      expect(slow.painted).toBeLessThan(1500 + Math.max(0, fast.painted - OWN.painted));
      expect(slow.seen).toBeLessThan(4000 + Math.max(0, fast.seen - OWN.seen));
    } finally {
      await browser.close();
      server.kill();
    }
  });
});
