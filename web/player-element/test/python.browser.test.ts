// What the player draws is what Python draws of what it decodes: the same surface, the same normals, from the same camera.

import { readFileSync } from "node:fs";
import { join } from "node:path";

import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, ROOT, runModule, runPython } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";
import { Site } from "./product.ts";

const [WIDTH, HEIGHT, FOV] = [320, 240, 45];

function renderedByPython(name: string, frame: number, camera: string): Uint8Array {
  const script = new URL("render.py", import.meta.url);
  return runPython(script, join(ROOT, `conformance/v1/${name}.reel`), frame, WIDTH, HEIGHT, FOV, camera);
}

interface Likeness {
  readonly covered: number; // pixels that both pictures cover
  readonly astray: number; // pixels that one covers, though the other covers none beside it
  readonly median: number; // largest difference of a colour, 0 to 255, over pixels that both cover
  readonly most: number; // what 90 % of these do not exceed
}

/** Both pictures have a white background. An outline may differ by a pixel: the player smooths its edges. */
function compare(wanted: Uint8Array, found: Uint8Array): Likeness {
  const covers = (picture: Uint8Array, x: number, y: number): boolean =>
    x >= 0 && y >= 0 && x < WIDTH && y < HEIGHT && [0, 1, 2].some((k) => picture[3 * (y * WIDTH + x) + k] < 250);
  const isNear = (picture: Uint8Array, x: number, y: number): boolean =>
    [-1, 0, 1].some((dx) => [-1, 0, 1].some((dy) => covers(picture, x + dx, y + dy)));
  const differences: number[] = [];
  let astray = 0;
  for (let y = 0; y < HEIGHT; y++) {
    for (let x = 0; x < WIDTH; x++) {
      const [a, b] = [covers(wanted, x, y), covers(found, x, y)];
      const at = 3 * (y * WIDTH + x);
      if (a && b) differences.push(Math.max(...[0, 1, 2].map((k) => Math.abs(wanted[at + k] - found[at + k]))));
      else if ((a && !isNear(found, x, y)) || (b && !isNear(wanted, x, y))) astray++;
    }
  }
  differences.sort((x, y) => x - y);
  return { covered: differences.length, astray, median: differences[differences.length >> 1], most: differences[Math.floor(0.9 * differences.length)] };
}

describeInBrowser("pictures of the player and of Python", () => {
  const site = new Site();
  beforeAll(() => site.open(), 120_000);
  afterAll(() => site.close());

  /** Looks at a frame from `away` times its size, and returns the camera. */
  async function look(page: Page, frame: number, away: number): Promise<string> {
    await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    const camera = await page.evaluate(([at, far]) => {
      const player = document.querySelector("meshreel-player")!;
      const { minimum, size } = player.info!.box;
      const middle = [0, 1, 2].map((k) => minimum[k] + size[k] / 2);
      const reach = Math.hypot(...size) * far;
      const eye = [middle[0] + 0.4 * reach, middle[1] + 0.3 * reach, middle[2] + 0.9 * reach];
      player.camera = [...eye, ...middle].map((value) => value.toFixed(4)).join(",");
      player.currentTime = (at + 0.25) / player.info!.frameRate;
      return player.camera;
    }, [frame, away] as const);
    await page.waitForFunction((at) => document.querySelector("meshreel-player")!.currentFrame === at && !document.querySelector("meshreel-player")!.seeking, frame);
    return camera;
  }

  /** The pixels of the player's picture, or of a PNG of the site. */
  async function pixels(page: Page, file: string | null = null): Promise<Uint8Array> {
    return Uint8Array.from(await page.evaluate(async ([width, height, address]) => {
      const png = address === null ? document.querySelector("meshreel-player")!.screenshot() : (await fetch(address)).blob();
      const context = new OffscreenCanvas(width, height).getContext("2d")!;
      context.drawImage(await createImageBitmap(await png), 0, 0, width, height);
      const { data } = context.getImageData(0, 0, width, height);
      return Array.from({ length: 3 * width * height }, (_, k) => data[4 * Math.floor(k / 3) + (k % 3)]);
    }, [WIDTH, HEIGHT, file] as const));
  }

  const cases: [string, number, number][] = [["scene", 3, 1.0], ["layers", 0, 1.2], ["laplacian", 1, 1.2]];
  test.skipIf(!hasPython).each(ALL ? cases : cases.slice(0, 1))("%s.reel, frame %i", async (name, frame, away) => {
    const parameters = `src=/${name}.reel&mode=normal&background=white&controls=0&interpolate=off`;
    const { page, errors } = await site.visit(`player/index.html?${parameters}`);
    const camera = await look(page, frame, away);
    const likeness = compare(renderedByPython(name, frame, camera), await pixels(page));
    expect(likeness.covered).toBeGreaterThan(1000);
    expect(likeness.astray / likeness.covered).toBeLessThan(0.005);
    expect(likeness.median).toBeLessThanOrEqual(4);
    expect(errors).toEqual([]);
    await page.close();
  });

  const looks: [string, number, number][] = [["layers", 0, 1.2], ["scene", 3, 1.0], ["colored/vertices", 2, 1.2], ["colored/textures", 1, 1.2]];
  test.skipIf(!hasPython).each(ALL ? looks : looks.slice(0, 1))("what is exported of %s.reel has the player's light and colours", async (name, frame, away) => {
    const file = join(ROOT, `conformance/v1/${name}.reel`);
    site.write("shown.reel", readFileSync(file));
    const { page, errors } = await site.visit("player/index.html?src=/shown.reel&background=white&controls=0&interpolate=off");
    const camera = await look(page, frame, away);
    const origin = await page.evaluate(() => document.querySelector("meshreel-player")!.info!.origin); // y is up in these files
    const view = camera.split(",").map((number, k) => Number(number) + origin[k % 3]);
    const png = join(site.folder, "exported.png");
    runModule("meshreel", "export", file, "-o", png, "--frames", `${frame}:`, `--view=${view}`, "--background", "white", "--size", `${WIDTH}x${HEIGHT}`);
    const [wanted, found] = [await pixels(page, "/exported.png"), await pixels(page)];
    const likeness = compare(wanted, found);
    expect(likeness.covered).toBeGreaterThan(1000);
    expect(likeness.astray / likeness.covered).toBeLessThan(0.005);
    expect(likeness.median).toBeLessThanOrEqual(name.includes("textures") ? 4 : 1); // browsers blend colours of videos in their own ways
    expect(likeness.most).toBeLessThanOrEqual(12);
    expect(errors).toEqual([]);
    await page.close();
  });
});
