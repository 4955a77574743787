// What the player draws is what Python draws of what it decodes: the same surface, the same normals, from the same camera.

import { join } from "node:path";

import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, ROOT, runPython } from "../../test/python.ts";
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
  return { covered: differences.length, astray, median: differences[differences.length >> 1] };
}

describeInBrowser("pictures of the player and of Python", () => {
  const site = new Site();
  beforeAll(() => site.open(), 120_000);
  afterAll(() => site.close());

  const cases: [string, number, number][] = [["scene", 3, 1.0], ["layers", 0, 1.2], ["laplacian", 1, 1.2]];
  test.skipIf(!hasPython).each(ALL ? cases : cases.slice(0, 1))("%s.reel, frame %i", async (name, frame, away) => {
    const parameters = `src=/${name}.reel&mode=normal&background=white&controls=0&interpolate=off`;
    const { page, errors } = await site.visit(`player/index.html?${parameters}`);
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
    const found = await page.evaluate(async ([width, height]) => {
      const picture = await createImageBitmap(await document.querySelector("meshreel-player")!.screenshot());
      const context = new OffscreenCanvas(width, height).getContext("2d")!;
      context.drawImage(picture, 0, 0, width, height);
      const { data } = context.getImageData(0, 0, width, height);
      return Array.from({ length: 3 * width * height }, (_, k) => data[4 * Math.floor(k / 3) + (k % 3)]);
    }, [WIDTH, HEIGHT] as const);
    const likeness = compare(renderedByPython(name, frame, camera), Uint8Array.from(found));
    expect(likeness.covered).toBeGreaterThan(1000);
    expect(likeness.astray / likeness.covered).toBeLessThan(0.005);
    expect(likeness.median).toBeLessThanOrEqual(4);
    expect(errors).toEqual([]);
    await page.close();
  });
});
