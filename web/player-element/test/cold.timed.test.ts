// How long a first visitor waits: on a slow line until something is seen and until the recording is, and anywhere until it is seen with all its layers.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { copyFileSync } from "node:fs";
import { join } from "node:path";

import { devices } from "playwright-core";
import type { Browser, BrowserContextOptions } from "playwright-core";
import { expect, test } from "vitest";

import { describeInBrowser, launchBrowser } from "../../test/browser.ts";
import { openLink } from "../../test/link.ts";
import { PYTHON, hasPython, ROOT } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";
import { Site } from "./product.ts";

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
    const painted = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime ?? NaN);
    return { painted, seen, bytes: link.bytes };
  } finally {
    await context.close();
    await link.close();
  }
}

/** One opening: until the first frame is shown, until the last byte of the recording came, and until all layers are shown, in ms. */
interface Opening {
  readonly seen: number;
  readonly last: number;
  readonly whole: number;
}

/** How long the picture was not whole, though its bytes were there: drawing for the first time takes what it takes. */
const behind = ({ seen, last, whole }: Opening): number => whole - Math.max(seen, last);

const OPENINGS = Number(process.env.MESHREEL_OPENINGS ?? 1); // of each kind
const SIZES = [320, 640, 1280]; // pixels of width
const KINDS: Readonly<Record<string, BrowserContextOptions & { readonly throttle?: number }>> = {
  ...Object.fromEntries(SIZES.map((width) => [`${width} px`, { viewport: { width, height: (3 * width) / 4 } }])),
  phone: { ...devices["Pixel 7"]!, throttle: 4 },
  "4 x slower": { viewport: { width: 640, height: 480 }, throttle: 4 },
};

/** Opens a page and waits until the picture that stands there has all layers. */
async function openOnce(browser: Browser, address: string, { throttle = 1, ...options }: (typeof KINDS)[string]): Promise<Opening> {
  const context = await browser.newContext(options);
  try {
    const page = await context.newPage();
    await (await context.newCDPSession(page)).send("Emulation.setCPUThrottlingRate", { rate: throttle });
    await page.goto(`${address}${address.includes("?") ? "&" : "?"}autoplay=0`, { waitUntil: "commit" });
    const when = async (isThere: () => boolean): Promise<number> => {
      await page.waitForFunction(isThere, undefined, { polling: 10 });
      return page.evaluate(() => performance.now());
    };
    const seen = await when(() => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0);
    const whole = await when(() => {
      const { layers, wholeLayers } = document.querySelector("meshreel-player")!.statistics!;
      return layers === wholeLayers;
    });
    const last = await page.evaluate(() => Math.max(...performance.getEntriesByType("resource").filter(({ name }) => name.endsWith(".reel")).map((entry) => entry.startTime + entry.duration)));
    return { seen, last, whole };
  } finally {
    await context.close();
  }
}

describeInBrowser("the player of meshreel play", () => {
  test.runIf(ALL && hasPython)("shows all layers at any size and speed, a second after the last byte at most", { timeout: 1e6 }, async () => {
    const server = spawn(PYTHON, ["-m", "meshreel", "play", process.env.MESHREEL_RECORDING ?? RECORDING, "--no-browser", "--json"]);
    const browser = await launchBrowser();
    try {
      const [line] = (await once(server.stdout, "data")) as [Buffer];
      const address = new URL((JSON.parse(line.toString()) as { addresses: string[] }).addresses[0]);
      await openOnce(browser, address.href, {}); // the first that the server and the browser see
      for (const [kind, options] of Object.entries(KINDS)) {
        const openings: Opening[] = [];
        for (let k = 0; k < OPENINGS; k++) openings.push(await openOnce(browser, address.href, options));
        const mean = (of: (opening: Opening) => number): string => (openings.reduce((sum, opening) => sum + of(opening), 0) / OPENINGS / 1000).toFixed(2);
        console.log(`${kind}: ${OPENINGS} of ${OPENINGS} whole; mean: first frame ${mean(({ seen }) => seen)} s, last byte ${mean(({ last }) => last)} s, whole ${mean(({ whole }) => whole)} s`);
        expect(Math.max(...openings.map(behind)), kind).toBeLessThan(1000 * (options.throttle ?? 1));
      }
      const link = await openLink(Number(address.port), BITS, MILLISECONDS);
      const slow = await openOnce(browser, link.origin + address.pathname + address.search, {});
      console.log(`slow line: last byte ${(slow.last / 1000).toFixed(2)} s, whole ${(slow.whole / 1000).toFixed(2)} s, ${link.bytes} bytes, which need ${(5 * MILLISECONDS) / 1000 + (8 * link.bytes) / BITS} s`);
      await link.close();
      expect(behind(slow)).toBeLessThan(1000);
    } finally {
      await browser.close();
      server.kill();
    }
  });
});

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

describeInBrowser("the player on a host that compresses nothing and closes each connection, on a cold line of 1 Mbit/s and 200 ms", () => {
  const EMBEDDED = '<!doctype html><link rel="icon" href="data:,"><h1>A room</h1><script type="module" src="player/load.js"></script><meshreel-player src="room.reel"></meshreel-player>';

  test.runIf(ALL)("shows its first frame within 5 s", async () => {
    const site = new Site();
    await site.open();
    try {
      copyFileSync(RECORDING, join(site.folder, "room.reel"));
      site.write("embedded.html", EMBEDDED);
      const origin = await site.serveAgain({ Connection: "close" });
      for (const page of ["player/index.html?src=/room.reel", "embedded.html"]) {
        const [slow, fast] = [await visit(site.browser, new URL(page, origin), BITS, MILLISECONDS), await visit(site.browser, new URL(page, origin), 1e9, 0)];
        console.log(`${page}: first paint ${(slow.painted / 1000).toFixed(2)} s, first frame ${(slow.seen / 1000).toFixed(2)} s (${(fast.seen / 1000).toFixed(2)} s without a line), ${slow.bytes} bytes`);
        expect(slow.seen, page).toBeLessThan(5000 + Math.max(0, fast.seen - OWN.seen));
      }
    } finally {
      await site.close();
    }
  });
});
