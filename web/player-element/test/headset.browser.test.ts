// The built player with a real recording in a simulated Quest 3: from the button to both eyes, and back to the page.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser } from "../../test/browser.ts";
import { ROOT } from "../../test/python.ts";
import { Site } from "./product.ts";

const IWER = join(dirname(createRequire(import.meta.url).resolve("iwer/package.json")), "build/iwer.js");

/** What the page of these tests has besides the player. */
interface Headset {
  press(button: string, value: 0 | 1): void;
  /** What both eyes see, taken within a frame of the headset: shares of pixels that differ from the background. */
  eyes(): Promise<[number, number]>;
  /** The picture's first pixel, with its alpha, of the last call of `eyes`. */
  corner(): number[];
  frames(count: number): Promise<void>;
}
declare const headset: Headset;

/** Runs in the page before anything else does. */
function installHeadset(): void {
  const { XRDevice, metaQuest3 } = (globalThis as unknown as { IWER: typeof import("iwer") }).IWER;
  const device = new XRDevice(metaQuest3, { stereoEnabled: true });
  device.installRuntime({ forceInstall: true });
  let [count, after] = [0, (): void => {}];
  const { prototype } = XRSession;
  const own = prototype.requestAnimationFrame;
  prototype.requestAnimationFrame = function (callback) {
    return own.call(this, (time, frame) => {
      callback(time, frame);
      count++;
      after();
    });
  };
  const covered = (pixels: ImageData, from: number, to: number): number => {
    let found = 0;
    for (let y = 0; y < pixels.height; y++) {
      for (let x = from; x < to; x++) {
        const at = 4 * (y * pixels.width + x);
        if ([0, 1, 2].some((k) => Math.abs(pixels.data[at + k]! - pixels.data[k]!) > 8)) found++;
      }
    }
    return found / (pixels.height * (to - from));
  };
  let corner: number[] = [];
  const api: Headset = {
    corner: () => corner,
    press: (button, value) => device.controllers.right?.updateButtonValue(button, value),
    async eyes() {
      const canvas = document.querySelector("canvas")!; // the device has taken the player's meanwhile
      const picture = await new Promise<ImageBitmap>((done, fail) => {
        after = () => {
          after = () => {};
          createImageBitmap(canvas).then(done, fail); // only now: the next frame clears it
        };
      });
      const { width, height } = picture;
      const context = new OffscreenCanvas(width, height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const pixels = context.getImageData(0, 0, width, height);
      corner = [...pixels.data.subarray(0, 4)];
      return [covered(pixels, 0, width >> 1), covered(pixels, width >> 1, width)];
    },
    async frames(more) {
      const until = count + more;
      while (count < until) await new Promise((done) => setTimeout(done, 5));
    },
  };
  Object.assign(globalThis, { headset: api });
}

describeInBrowser("the built player in a headset", () => {
  const site = new Site();
  beforeAll(() => site.open(), 120_000);
  afterAll(() => site.close());

  async function press(page: Page, button: string): Promise<void> {
    for (const value of [1, 0] as const) {
      await page.evaluate(async ([name, to]) => {
        headset.press(name, to);
        await headset.frames(2);
      }, [button, value] as const);
    }
  }

  test("both eyes see the recording, the trigger plays it, and the page is as it was afterwards", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/layers.reel&loop&speed=0.1", [{ path: IWER }, installHeadset]);
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    const camera = await page.evaluate(() => document.querySelector("meshreel-player")!.camera);
    await page.locator("button.vr").click();
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.presenting);
    await page.evaluate(() => headset.frames(3));
    for (const share of await page.evaluate(() => headset.eyes())) expect(share).toBeGreaterThan(0.005);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.paused)).toBe(true);
    await press(page, "trigger");
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.paused && document.querySelector("meshreel-player")!.currentTime > 0);
    await page.evaluate(() => document.querySelector("meshreel-player")!.exitVr());
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.presenting);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.camera)).toBe(camera);
    const drawn = await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.drawn);
    await page.waitForFunction((before) => document.querySelector("meshreel-player")!.statistics!.drawn > before, drawn); // by the page's own frames
    expect(errors).toEqual([]);
    await page.close();
  });

  test("in the viewer's own room nothing but the recording and its shadow is drawn", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/layers.reel&background=white", [{ path: IWER }, installHeadset]);
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    await page.locator("button.ar").click();
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.presenting);
    await page.evaluate(() => headset.frames(3));
    for (const share of await page.evaluate(() => headset.eyes())) expect(share).toBeGreaterThan(0.005);
    expect(await page.evaluate(() => headset.corner())).toEqual([0, 0, 0, 0]); // where a headset shows the room
    await page.evaluate(() => document.querySelector("meshreel-player")!.exitVr());
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.presenting);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("both eyes see splats, where nothing else is drawn", async () => {
    site.write("splats.reel", readFileSync(join(ROOT, "conformance/v1/splats/splats.reel")));
    const { page, errors } = await site.visit("player/index.html?src=/splats.reel&t=0.28&background=white", [{ path: IWER }, installHeadset]); // without patches
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.splats ?? 0) > 0);
    await page.locator("button.ar").click();
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.presenting);
    await page.evaluate(() => headset.frames(3));
    const [left, right] = await page.evaluate(() => headset.eyes());
    expect(left).toBeGreaterThan(0.002);
    expect(Math.abs(left - right)).toBeLessThan(0.2 * left);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a bench during which the headset is entered measures the headset alone", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/layers.reel&bench=2", [{ path: IWER }, installHeadset]);
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.paused);
    await page.mouse.move(100, 100); // controls hide while it plays
    await page.locator("button.vr").click();
    const text = await page.waitForFunction(() => document.querySelector("pre")!.textContent!.split("\n").find((line) => line.startsWith("{")));
    expect(JSON.parse((await text.jsonValue())!)).toMatchObject({ place: "VR", displayRate: 90 });
    expect(errors).toEqual([]);
    await page.close();
  });
});
