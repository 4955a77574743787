// The built player with splats: shown where the file has some, switched on and off, counted in the statistics.

import { readFileSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser } from "../../test/browser.ts";
import { ROOT } from "../../test/python.ts";
import { Site } from "./product.ts";

const SPLATS = 300; // of each group of the file that has some
const COLOR = 100; // of 255, between red, green and blue: clay has less

describeInBrowser("the player and splats", () => {
  const site = new Site();
  beforeAll(async () => {
    await site.open();
    site.write("splats.reel", readFileSync(join(ROOT, "conformance/v1/splats/splats.reel")));
  }, 240_000);
  afterAll(() => site.close());

  const open = async (more = "", scripts: Parameters<Site["visit"]>[1] = []): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?src=/splats.reel&background=white&controls=0${more}`, scripts);
    await found.page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    return found;
  };
  const splats = (page: Page): Promise<number> => page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.splats);
  /** Shares of pixels that are not white, and that are colourful. */
  const lookAt = (page: Page): Promise<[number, number]> =>
    page.evaluate(async (most) => {
      const picture = await createImageBitmap(await document.querySelector("meshreel-player")!.screenshot());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      let [covered, colorful] = [0, 0];
      for (let i = 0; i < data.length; i += 4) {
        const pixel = [...data.subarray(i, i + 3)];
        if (Math.min(...pixel) < 250) covered++;
        if (Math.max(...pixel) - Math.min(...pixel) > most) colorful++;
      }
      return [(4 * covered) / data.length, (4 * colorful) / data.length];
    }, COLOR);
  const setMode = (page: Page, mode: string): Promise<void> =>
    page.evaluate((wanted) => void document.querySelector("meshreel-player")!.setAttribute("mode", wanted), mode);
  const mode = (page: Page): Promise<string> => page.evaluate(() => document.querySelector("meshreel-player")!.mode);

  test("shows them where the file has some, puts them in order in a worker, and the mesh where it is told to", async () => {
    const { page, errors } = await open();
    await expect.poll(() => splats(page)).toBe(SPLATS);
    expect(await mode(page)).toBe("splats");
    await expect.poll(() => page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.sortMs)).toBeGreaterThan(0);
    const [covered, colorful] = await lookAt(page);
    expect(colorful).toBeGreaterThan(0.02 * covered); // most of the splats are small and pale
    await setMode(page, "color"); // which the file has not
    await expect.poll(() => splats(page)).toBe(0);
    expect(await mode(page)).toBe("shaded");
    expect((await lookAt(page))[1]).toBe(0);
    await setMode(page, "splats");
    await expect.poll(() => splats(page)).toBe(SPLATS);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("fetches them when they are asked for, and shows groups without as before", async () => {
    const { page, errors } = await open("&mode=shaded");
    expect(await splats(page)).toBe(0);
    await setMode(page, "splats");
    await expect.poll(() => splats(page)).toBe(SPLATS);
    await page.evaluate(() => document.querySelector("meshreel-player")!.step(11)); // of a form that has none
    await expect.poll(() => splats(page)).toBe(0);
    const [covered, colorful] = await lookAt(page);
    expect([covered > 0.01, colorful]).toEqual([true, 0]);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("orders them on the page where no worker can be started", async () => {
    const withoutOrder = (): void => {
      const Own = globalThis.Worker;
      globalThis.Worker = class extends Own {
        constructor(address: string | URL, options?: WorkerOptions) {
          if (String(address).includes("order")) throw new Error("no more workers");
          super(address, options);
        }
      };
    };
    const { page, errors } = await open("", [withoutOrder]);
    await expect.poll(() => splats(page)).toBe(SPLATS);
    expect((await lookAt(page))[1]).toBeGreaterThan(0);
    expect(errors).toEqual([]);
    await page.close();
  });
});
