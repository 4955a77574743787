// The scene in Chromium: what is drawn, what the GPU has, and that showing a frame brings nothing to it.

import { fileURLToPath } from "node:url";

import { afterAll, afterEach, beforeAll, expect, test } from "vitest";

import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import type { Mode } from "../src/index.ts";
import { trackColor } from "../src/colors.ts";
import type { Vector } from "../src/octahedral.ts";
import { RADIUS, makeFloor, makeGroup } from "./analytic.ts";
import type {} from "./pages/scene.ts";

const [WIDTH, HEIGHT] = [320, 240];
const UNUSED = -1e9; // what the page says of a vertex that nothing was drawn for
const FOCAL = HEIGHT / 2 / Math.tan((25 * Math.PI) / 180);
const EYE = 3; // m before the middle

/** The pixel in the middle of which a point is seen from (0, 0, EYE). */
function pixelOf([x, y, z]: Vector): readonly [number, number] {
  return [Math.floor(WIDTH / 2 + (FOCAL * x) / (EYE - z)), Math.floor(HEIGHT / 2 + (FOCAL * y) / (EYE - z))];
}

describeInBrowser("a scene in Chromium", () => {
  let open: OpenPage;
  beforeAll(async () => {
    open = await openPage(fileURLToPath(new URL("pages/scene.ts", import.meta.url)));
  }, 120_000);
  afterAll(async () => open?.close());
  afterEach(async () => {
    expect(open.errors).toEqual([]);
    await open.page.evaluate(() => window.api.renew());
  });

  async function picture(frame: number, mode: Mode = "normal", blend = 0): Promise<(point: Vector) => number[]> {
    const text = await open.page.evaluate(([f, m, b]) => {
      window.api.look(m as Mode);
      window.api.show(f as number, b as number);
      return window.api.draw();
    }, [frame, mode, blend]);
    const pixels = Buffer.from(text, "base64");
    return (point) => {
      const [column, row] = pixelOf(point);
      const at = 4 * (row * WIDTH + column);
      return [...pixels.subarray(at, at + 3)];
    };
  }

  const WHITE = [255, 255, 255];
  const LOOKS_HERE = [128, 128, 255]; // rgb = (n + 1) / 2 of +z

  function expectNear(found: number[], wanted: readonly number[], tolerance = 6): void {
    found.forEach((value, k) => expect(Math.abs(value - wanted[k]), `${found} is not ${wanted}`).toBeLessThanOrEqual(tolerance));
  }

  test("a sphere is where each frame has it, with its own normals", async () => {
    await open.page.evaluate(() => window.api.prepare(false));
    for (let t = 0; t < 4; t++) {
      const at = await picture(t);
      const x = -0.6 + 0.4 * t;
      expectNear(at([x, 0, RADIUS]), LOOKS_HERE);
      const slant = RADIUS * Math.SQRT1_2;
      expectNear(at([x + slant, 0, slant]), [255 * (0.5 + 0.5 * Math.SQRT1_2), 128, 255 * (0.5 + 0.5 * Math.SQRT1_2)], 12);
      expect(at([x > 0 ? -1 : 1, 0, 0])).toEqual(WHITE);
    }
  });

  test("between two frames it is between their places, and what one frame has alone stands still", async () => {
    await open.page.evaluate(() => window.api.prepare(false));
    const at = await picture(1, "normal", 0.5);
    expectNear(at([0, 0, RADIUS]), LOOKS_HERE);
    expect(at([-0.2 - RADIUS + 0.03, 0, 0])).toEqual(WHITE);
    for (const [frame, wanted] of [[1, WHITE], [2, LOOKS_HERE], [3, WHITE]] as const) {
      expectNear((await picture(frame))([0, 0.6, 0]), wanted);
    }
    expectNear((await picture(2, "normal", 0.7))([0, 0.6, 0]), LOOKS_HERE);
  });

  test("modes look as they are called", async () => {
    await open.page.evaluate(() => window.api.prepare(false, true));
    const middle: Vector = [0.2, 0, RADIUS];
    const colour = (await picture(2, "colour"))(middle);
    expectNear(colour, trackColor(0).map((share) => 255 * share));
    expectNear((await picture(2, "colour"))([0, 0.8, RADIUS]), trackColor(1).map((share) => 255 * share));
    const shaded = await picture(2, "shaded");
    const [front, side] = [shaded(middle), shaded([0.2 + 0.28, 0, 0.1])];
    expect(front[0]).toBeGreaterThan(side[0] + 20);
    const edges = await picture(2, "wireframe");
    const line = Array.from({ length: 40 }, (_, k) => edges([0.05 + 0.0075 * k, 0.02, 0.29])[0]);
    expect(Math.min(...line)).toBeLessThan(Math.max(...line) - 60);
  });

  test("positions on the GPU are the packed ones, to half a step of the box; blends are linear", async () => {
    await open.page.evaluate(() => window.api.prepare(true));
    const group = makeGroup();
    const floor = makeFloor();
    const compare = (found: number[], wanted: readonly (Vector | null)[], size: readonly number[]): number => {
      let compared = 0;
      wanted.forEach((position, v) => {
        if (position === null || found[3 * v] === UNUSED) return;
        for (let k = 0; k < 3; k++) expect(Math.abs(found[3 * v + k] - position[k])).toBeLessThanOrEqual(0.501 * (size[k] / 65535) + 1e-6);
        compared++;
      });
      return compared;
    };
    for (const frame of [0, 2, 3]) {
      const found = await open.page.evaluate((f) => window.api.read("group", f, 0), frame);
      expect(compare(found, group.positions[frame], group.packed.box.size)).toBeGreaterThanOrEqual(group.packed.vertexCount);
    }
    const [low, high] = [group.positions[1], group.positions[2]];
    const blended = low.map((p, v): Vector | null => (v < group.packed.vertexCount ? ([0, 1, 2].map((k) => 0.75 * p![k] + 0.25 * high[v]![k]) as unknown as Vector) : null));
    const found = await open.page.evaluate(() => window.api.read("group", 1, 0.25));
    expect(compare(found, blended, group.packed.box.size)).toBe(group.packed.vertexCount);
    const still = await open.page.evaluate(() => window.api.read("static", 0, 0));
    expect(compare(still, floor.positions, floor.packed.box.size)).toBe(floor.positions.length);
  });

  test("showing a prepared frame brings nothing to the GPU", async () => {
    await open.page.evaluate(() => {
      window.api.prepare(true, true);
      window.api.look("shaded");
      window.api.show(0);
      window.api.draw();
    });
    for (const frame of [1, 2, 3, 0]) expect(await open.page.evaluate((f) => window.api.uploadsWhileShowing(f), frame)).toEqual([]);
    const numbers = await open.page.evaluate(() => window.api.numbers());
    expect(numbers.drawn).toBe(numbers.triangles);
  });

  test("what is released is free: forty times prepared and released, the GPU has no more than before", async () => {
    await open.page.evaluate(() => {
      window.api.prepare(true);
      window.api.show(2);
      window.api.draw();
      window.api.release();
    });
    const before = await open.page.evaluate(() => window.api.numbers());
    expect(before.gpuBytes).toBe(0);
    await open.page.evaluate(() => {
      for (let count = 0; count < 40; count++) {
        window.api.prepare(true);
        window.api.look(count % 2 ? "wireframe" : "shaded");
        window.api.show(count % 4);
        window.api.draw();
        window.api.release();
      }
    });
    const after = await open.page.evaluate(() => window.api.numbers());
    expect(after.gpuBytes).toBe(0);
    expect(after.textures).toBeLessThanOrEqual(before.textures);
    expect(after.geometries).toBeLessThanOrEqual(before.geometries);
  });

  test("a context that is lost and restored draws the same again", async () => {
    await open.page.evaluate(() => window.api.prepare(true));
    const points: Vector[] = [[0.2, 0, RADIUS], [0, 0.6, 0], [0, -0.5, 1.2], [1.2, 0.9, 0]];
    const before = await picture(2);
    await open.page.evaluate(() => window.api.loseContext());
    const after = await picture(2);
    for (const point of points) expectNear(after(point), before(point), 2);
    expect(before(points[0])).not.toEqual(WHITE);
    open.errors.splice(0, open.errors.length, ...open.errors.filter((text) => !/context/i.test(text))); // three tells of it
  });
});
