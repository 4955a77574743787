// The built player with a recording that has colours: unlit as they are in the file, unless somebody asks for another look.

import { join } from "node:path";

import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";

import { Video } from "../../player-core/test/whole_video.ts";
import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, ROOT, runPython } from "../../test/python.ts";
import { nodeCore } from "../../player-core/test/tools.ts";
import { Site } from "./product.ts";

const NAMES = ["scene", "layers", "draco"];

describeInBrowser("the player and a recording's own colours", () => {
  const site = new Site();
  let files: Record<string, { readonly file: string }>;
  beforeAll(async () => {
    await site.open();
    if (!hasPython) return;
    const script = new URL("../../player-core/test/colored.py", import.meta.url);
    files = JSON.parse(runPython(script, "--flat", ...NAMES.map((name) => join(ROOT, `conformance/v1/${name}.reel`))).toString()) as typeof files;
    for (const name of NAMES) site.write(`${name}-flat.reel`, Buffer.from(files[name].file, "base64"));
  });
  afterAll(() => site.close());

  const open = async (file: string, controls = 0): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?src=/${file}.reel&background=white&ground=off&controls=${controls}`);
    await found.page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    return found;
  };

  /** The colours of a picture, or of the player's, and how many pixels have each. */
  const colorsOf = (page: Page, png?: Buffer): Promise<Record<string, number>> =>
    page.evaluate(async (address) => {
      const picture = await createImageBitmap(await (address ? (await fetch(address)).blob() : document.querySelector("meshreel-player")!.screenshot()));
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      const found: Record<string, number> = {};
      for (let i = 0; i < data.length; i += 4) {
        const color = [...data.subarray(i, i + 3)].join(",");
        found[color] = (found[color] ?? 0) + 1;
      }
      return found;
    }, png && `data:image/png;base64,${png.toString("base64")}`);

  test("on a transparent background the page is seen around the recording", async () => {
    site.write("clear.html", `<!doctype html><link rel="icon" href="data:,"><body style="margin:0;background:#ff8000"><script type="module" src="player/meshreel-player.js"></script>
      <meshreel-player src="scene.reel" background="transparent"></meshreel-player>`);
    const { page, errors } = await site.visit("clear.html");
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    const { "255,128,0": behind, "0,0,0": black = 0, ...others } = await colorsOf(page, await page.locator("meshreel-player").screenshot());
    expect(behind).toBeGreaterThan(10_000);
    expect(Object.keys(others).length).toBeGreaterThan(20);
    expect(black).toBe(0);
    expect(errors).toEqual([]);
    await page.close();
  });

  test.skipIf(!hasPython).each(NAMES)("%s.reel is shown in them, to the byte", async (name) => {
    const video = new Video(await nodeCore(), Uint8Array.from(Buffer.from(files[name].file, "base64")));
    const wanted = [...video.frame(0).colors!.subarray(0, 3)].join(",");
    const { page, errors } = await open(`${name}-flat`);
    expect(await page.evaluate(() => [document.querySelector("meshreel-player")!.mode, document.querySelector("meshreel-player")!.info!.hasColors])).toEqual(["color", true]);
    const { [wanted]: own = 0, "255,255,255": white = 0, ...others } = await colorsOf(page);
    expect(own).toBeGreaterThan(500);
    expect(Object.values(others).reduce((sum, count) => sum + count, 0)).toBeLessThan(0.2 * own); // outlines are smoothed
    await page.evaluate(() => void (document.querySelector("meshreel-player")!.mode = "shaded"));
    await page.waitForTimeout(100);
    const lit = await colorsOf(page);
    expect(lit["255,255,255"]).toBe(white);
    expect(Object.keys(lit).length).toBeGreaterThan(Object.keys(others).length + 10);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a recording without a room has a ground with its shadow, unless there is to be none", async () => {
    const seen: Record<string, number>[] = [];
    for (const ground of ["on", "off"]) {
      const { page, errors } = await site.visit(`player/index.html?src=/layers.reel&background=white&controls=0&mode=shaded&ground=${ground}`);
      await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
      seen.push(await colorsOf(page));
      await page.evaluate(() => void (document.querySelector("meshreel-player")!.mode = "normal")); // which says something of surfaces alone
      await page.waitForTimeout(100);
      seen.push(await colorsOf(page));
      expect(errors).toEqual([]);
      await page.close();
    }
    const [on, bare, off, normals] = seen.map((colors) => colors["255,255,255"]!);
    expect(on).toBeLessThan(0.95 * off!);
    expect([bare, normals]).toEqual([off, off]);
  });

  test("on a dark page the ground is brighter, so that its shadow is seen, and exposure darkens what is lit", async () => {
    const { page } = await site.visit("player/index.html?src=/layers.reel&background=rgb(20,23,28)&controls=0&mode=shaded");
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    const greys = Object.entries(await colorsOf(page)).map(([color, count]) => [Number(color.split(",")[0]), count] as const);
    const bright = greys.reduce((sum, [red, count]) => sum + (red > 32 && red < 75 ? count : 0), 0);
    expect(bright).toBeGreaterThan(3000);
    const brightest = async (): Promise<number> => Math.max(...Object.keys(await colorsOf(page)).map((color) => Number(color.split(",")[0])));
    const usual = await brightest();
    await page.evaluate(() => void (document.querySelector("meshreel-player")!.exposure = 0.5));
    expect(await brightest()).toBeLessThan(0.6 * usual); // the body is the brightest of what is seen
    await page.close();
  });

  test.skipIf(!hasPython)("the key M goes through all looks, and colours are one of them where there are some", async () => {
    const seen = async (file: string, count: number): Promise<string[]> => {
      const { page } = await open(file, 1);
      const modes: string[] = [];
      for (let k = 0; k < count; k++) {
        modes.push(await page.evaluate(() => document.querySelector("meshreel-player")!.mode));
        await page.keyboard.press("m");
      }
      await page.close();
      return modes;
    };
    expect(await seen("layers-flat", 6)).toEqual(["color", "shaded", "normal", "wireframe", "tracks", "color"]);
    expect(await seen("layers", 5)).toEqual(["shaded", "normal", "wireframe", "tracks", "shaded"]);
  });
});
