// The built player with a textured recording, as Chromium's own AV1 decoder gives it: each frame in its own picture.

import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, runPython } from "../../test/python.ts";
import { Site } from "./product.ts";

const FRAMES = 8;
const NEAR = 14; // of 255, between what Python and the browser make of a picture
const WITHOUT_WEBCODECS = (): void => void Reflect.deleteProperty(globalThis, "VideoDecoder");

describeInBrowser("the player and textures", () => {
  const site = new Site();
  beforeAll(async () => {
    await site.open();
    if (!hasPython) return;
    const made = JSON.parse(runPython(new URL("../../player-core/test/textured.py", import.meta.url), FRAMES, 4).toString()) as { file: string };
    site.write("textured.reel", Buffer.from(made.file, "base64"));
  }, 240_000);
  afterAll(() => site.close());

  const open = async (more = "", scripts: Parameters<Site["visit"]>[1] = []): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?src=/textured.reel&background=white&controls=0${more}`, scripts);
    await found.page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    return found;
  };

  /** The mean red and the spread of green over the body's pixels at a frame. */
  const lookAt = (page: Page, frame: number): Promise<[number, number]> =>
    page.evaluate(async (wanted) => {
      const player = document.querySelector("meshreel-player")!;
      const arrived = new Promise((done) => player.addEventListener("seeked", done, { once: true }));
      player.currentTime = wanted / player.info!.frameRate;
      await arrived;
      const picture = await createImageBitmap(await player.screenshot());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      const [reds, greens]: [number[], number[]] = [[], []];
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 2] > 120) continue; // not the body, whose blue is 60
        reds.push(data[i]);
        greens.push(data[i + 1]);
      }
      greens.sort((a, b) => a - b);
      return [reds.reduce((sum, red) => sum + red, 0) / reds.length, greens[Math.floor(0.9 * greens.length)] - greens[Math.floor(0.1 * greens.length)]];
    }, frame);

  test.skipIf(!hasPython)("shows each frame in its own picture, to and fro", async () => {
    const { page, errors } = await open();
    for (const frame of [1, 7, 0, 5, 4, 2]) {
      const [red, spread] = await lookAt(page, frame);
      expect(Math.abs(red - (40 + Math.floor((200 * frame) / (FRAMES - 1)))), `frame ${frame}`).toBeLessThan(NEAR);
      expect(spread).toBeGreaterThan(110); // of checks of 0 and 160
    }
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.textures)).toBe("shown");
    expect(errors).toEqual([]);
    await page.close();
  });

  test.skipIf(!hasPython).each([
    ["off", "&textures=off", []],
    ["unsupported", "", [WITHOUT_WEBCODECS]],
  ] as const)("shows the colours of vertices where textures are %s", async (state, more, scripts) => {
    const { page, errors } = await open(more, scripts);
    const [red] = await lookAt(page, 7);
    expect(red).toBeGreaterThan(180);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.textures)).toBe(state);
    expect(errors).toEqual([]);
    await page.close();
  });
});
