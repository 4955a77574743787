import { fileURLToPath } from "node:url";
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, test } from "vitest";
import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import { FLOOR_COLOR, makeFloor, makeGroup, RADIUS, sphereColor, SQUARE, SQUARE_COLOR } from "./analytic.ts";
import { trackColor } from "../src/colors.ts";
import type { Vector } from "../src/colors.ts";
import { Picture } from "./picture.ts";
import type { Mode } from "../src/index.ts";
import type {} from "./pages/scene.ts";

const UNUSED = -1e9;
const FLOAT32 = 1e-6; // m: two roundings of numbers up to 4
const WHITE = [255, 255, 255];
const SPHERE_TRIANGLES = 2 * 16 * 32;

/** The normal of the sphere where the camera at (0, 0, 3) sees a point of its center's plane. */
function normalSeen(center: Vector, point: Vector): Vector {
  const eye: Vector = [0, 0, 3];
  const ray = normalize(subtract(point, eye));
  const from = subtract(eye, center);
  const half = dot(ray, from);
  const along = -half - Math.sqrt(half * half - dot(from, from) + RADIUS * RADIUS);
  return normalize([from[0] + along * ray[0], from[1] + along * ray[1], from[2] + along * ray[2]]);
}

const subtract = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const normalize = (a: Vector): Vector => [a[0] / Math.hypot(...a), a[1] / Math.hypot(...a), a[2] / Math.hypot(...a)];
const colorOf = (normal: Vector): number[] => normal.map((value) => 127.5 * (value + 1));

describeInBrowser("a scene in Chromium", () => {
  let open: OpenPage;
  beforeAll(async () => {
    open = await openPage(fileURLToPath(new URL("pages/scene.ts", import.meta.url)));
  });
  afterAll(async () => open?.close());
  beforeEach(async () => {
    await open.page.evaluate(() => {
      window.api.renew();
      window.api.look("normal");
      window.api.camera(0, 0, 3);
    });
  });
  afterEach(() => expect(open.errors).toEqual([]));

  const picture = async (): Promise<Picture> => new Picture(await open.page.evaluate(() => window.api.draw()));
  const prepare = (withFloor: boolean, secondTrack = false): Promise<void> =>
    open.page.evaluate(([floor, track]) => window.api.prepare(floor, track), [withFloor, secondTrack]);
  const show = (frame: number, blend = 0): Promise<void> => open.page.evaluate(([f, b]) => window.api.show(f, b), [frame, blend]);
  const look = (mode: Mode, flat = false): Promise<void> => open.page.evaluate(([m, f]) => window.api.look(m, f), [mode, flat] as const);
  const numbers = () => open.page.evaluate(() => window.api.numbers());
  const positions = (kind: "group" | "static", frame: number, blend: number): Promise<number[]> =>
    open.page.evaluate(([k, f, b]) => window.api.read(k, f, b), [kind, frame, blend] as const);

  test("the floor of a room takes a soft shadow of what moves, if it has no colours, which have one in them", async () => {
    for (const [share, prepared] of [[0.01, () => window.api.prepare(true)], [0, () => window.api.prepareColored()]] as const) {
      await open.page.evaluate(prepared);
      await look("shaded");
      await open.page.evaluate(() => window.api.camera(0, 2, 3));
      await show(0);
      const before = await picture();
      await open.page.evaluate(() => window.api.shade());
      const shaded = await picture();
      expect(shaded.difference(before)).toBeGreaterThanOrEqual(share);
      expect(shaded.difference(before)).toBeLessThan(share === 0 ? 1e-9 : 0.2);
      await open.page.evaluate(() => window.api.renew());
    }
  });

  test("a sphere is where its frame has it, with its normals as colours", async () => {
    await prepare(false);
    for (const t of [0, 1, 3]) {
      await show(t);
      const drawn = await picture();
      const center: Vector = [-0.6 + 0.4 * t, 0, 0];
      for (const [x, y] of [[0, 0], [0.7, 0], [-0.7, 0], [0, 0.7], [-0.5, -0.5]]) {
        const point: Vector = [center[0] + RADIUS * x, RADIUS * y, 0];
        expect(drawn.at(point)).toBeNear(colorOf(normalSeen(center, point)), 6);
      }
      expect(drawn.at([center[0] + 1.3 * RADIUS, 0, 0])).toEqual(WHITE);
      expect(drawn.at([center[0] - 1.3 * RADIUS, 0, 0])).toEqual(WHITE);
      expect(drawn.at(SQUARE)).toEqual(WHITE); // only frame 2 has it
    }
  });

  test("what one frame has alone is drawn in that frame, blended or not", async () => {
    await prepare(false);
    for (const blend of [0, 0.5]) {
      await show(2, blend);
      const drawn = await picture();
      expect(drawn.at(SQUARE)).toBeNear([128, 128, 255], 2);
      expect((await numbers()).drawn).toBe(SPHERE_TRIANGLES + 2);
      expect((await numbers()).triangles).toBe(SPHERE_TRIANGLES + 2);
    }
    await show(1);
    await picture();
    expect((await numbers()).drawn).toBe(SPHERE_TRIANGLES);
  });

  test("a track that holds a frame stands in it, whatever the recording's own frame", async () => {
    const pixels = (): Promise<string> => open.page.evaluate(() => window.api.draw());
    await prepare(false);
    await show(1);
    const still = await pixels();
    await open.page.evaluate(() => window.api.show(2, 0.5, 1));
    expect(await pixels()).toEqual(still);
    expect((await numbers()).triangles).toBe(SPHERE_TRIANGLES);
    await show(1, 0.5);
    expect(await pixels()).not.toEqual(still);
  });

  test("positions read back are the decoder's within one step of quantisation", async () => {
    await prepare(true);
    const { packed, positions: truth } = makeGroup();
    for (const t of [0, 2, 3]) {
      const read = await positions("group", t, 0);
      truth[t].forEach((position, v) => {
        const expected = position ?? [UNUSED, UNUSED, UNUSED];
        for (let k = 0; k < 3; k++) expect(Math.abs(read[3 * v + k] - expected[k])).toBeLessThanOrEqual(packed.box.size[k] / 65535);
      });
      expect(new Set(read.slice(3 * truth[t].length))).toEqual(new Set([UNUSED])); // padding
    }
    const floor = makeFloor();
    const read = await positions("static", 0, 0);
    expect(read.length).toBe(3 * floor.positions.length);
    floor.positions.flat().forEach((value, i) => expect(Math.abs(read[i] - value)).toBeLessThanOrEqual(floor.packed.box.size[i % 3] / 65535 + FLOAT32));
  });

  test("between two frames vertices move in a straight line, those of one frame stay", async () => {
    await prepare(false);
    const { packed } = makeGroup();
    const [here, next] = [await positions("group", 2, 0), await positions("group", 3, 0)];
    for (const blend of [0.25, 0.5, 1]) {
      const between = await positions("group", 2, blend);
      for (let i = 0; i < between.length; i++) {
        const moves = i < 3 * packed.vertexCount;
        const expected = moves ? here[i] + blend * (next[i] - here[i]) : here[i];
        expect(Math.abs(between[i] - expected)).toBeLessThan(FLOAT32);
      }
    }
  });

  test("the last frame of a group is not blended with anything behind it", async () => {
    await prepare(false);
    expect(await positions("group", 3, 0.5)).toEqual(await positions("group", 3, 0));
  });

  test("modes and flat normals differ, and every mode draws the same silhouette", async () => {
    await prepare(true, true);
    await open.page.evaluate(() => window.api.camera(0.8, 1, 2.6));
    const looks: [Mode, boolean][] = [["shaded", false], ["normal", false], ["wireframe", false], ["tracks", false], ["shaded", true], ["normal", true]];
    const pictures: Picture[] = [];
    for (const [mode, flat] of looks) {
      await look(mode, flat);
      await show(2);
      pictures.push(await picture());
    }
    for (const [i, one] of pictures.entries()) {
      expect(one.covered()).toBe(pictures[0].covered());
      for (const other of pictures.slice(i + 1)) expect(one.difference(other)).toBeGreaterThan(0.005);
    }
    expect(pictures[0].covered()).toBeGreaterThan(0.3);
    expect(pictures[3].colors()).toBe(4); // white, two tracks, the background
  });

  test("modes look as they are called", async () => {
    await prepare(false, true);
    const looking = async (mode: Mode): Promise<Picture> => {
      await look(mode);
      await show(2);
      return picture();
    };
    const colour = await looking("tracks");
    expect(colour.at([0.2, 0, 0])).toBeNear(trackColor(0).map((share) => 255 * share), 2);
    expect(colour.at([0, 0.8, 0])).toBeNear(trackColor(1).map((share) => 255 * share), 2);
    const shaded = await looking("shaded");
    expect(shaded.at([0.2, 0, 0])[0]).toBeGreaterThan(shaded.at([0.2 - 0.9 * RADIUS, 0, 0])[0] + 20); // darker away from the lamp, which is to the right
    await open.page.evaluate(() => window.api.look("shaded", false, 0.5));
    await show(2);
    expect((await picture()).at([0.2, 0, 0])).toBeNear(shaded.at([0.2, 0, 0]).map((value) => value / 2), 2);
    const edges = await looking("wireframe");
    const line = Array.from({ length: 40 }, (_, k) => edges.at([0.05 + 0.0075 * k, 0.02, 0])[0]);
    expect(Math.min(...line)).toBeLessThan(Math.max(...line) - 60);
  });

  test("a face that is seen aslant from behind, as slivers at an outline are, is lit as from the front", async () => {
    await prepare(true);
    await look("shaded");
    await show(0);
    const seen: number[][] = [];
    for (const height of [-0.45, -0.55]) { // above the floor, and below it
      await open.page.evaluate((y) => window.api.camera(0, y, 3), height);
      seen.push((await picture()).at([0.9, -0.5, 0]));
    }
    expect(seen[0]).not.toEqual(WHITE);
    expect(seen[1]).toBeNear(seen[0]!, 12);
  });

  describe("colours of its own", () => {
    const FLOOR: Vector = [-0.85, -0.5, 0.9];
    const LONE: Vector = [0.9, 0.8, 0]; // the middle of what has none
    const looking = async (mode: Mode, frame: number, blend = 0): Promise<Picture> => {
      await look(mode);
      await show(frame, blend);
      return picture();
    };
    beforeEach(() => open.page.evaluate(() => window.api.prepareColored()));

    test("are the file's to the byte, of every frame and of single ones; what has none is shaded", async () => {
      for (const t of [0, 2]) {
        const drawn = await looking("color", t);
        expect(drawn.at([-0.6 + 0.4 * t, 0, 0])).toEqual(sphereColor(t));
        expect(drawn.at(FLOOR)).toEqual(FLOOR_COLOR);
        if (t === 2) expect(drawn.at(SQUARE)).toEqual(SQUARE_COLOR);
        expect(drawn.at(LONE)).toEqual((await looking("shaded", t)).at(LONE));
      }
    });

    test("were uploaded before the first picture", async () => {
      expect(await open.page.evaluate(() => window.api.uploadsWhileShowing(2))).toEqual([]);
    });

    test("are blended between frames", async () => {
      const drawn = await looking("color", 0, 0.25);
      expect(drawn.at([-0.5, 0, 0])).toBeNear([40 + 12.5, 200, 17], 1);
    });

    test("take the place of clay in light, with edges as well", async () => {
      const [shaded, edges, clay] = [await looking("shaded", 2), await looking("wireframe", 2), await looking("tracks", 2)];
      for (const drawn of [shaded, edges]) {
        const lit = drawn.at(FLOOR);
        const share = lit[1] / FLOOR_COLOR[1];
        expect(share).toBeGreaterThan(0.7); // light is in them already
        expect(share).toBeLessThan(1.2);
        expect(lit).toBeNear(FLOOR_COLOR.map((value) => share * value), 1);
      }
      expect(shaded.at([0.2, 0, 0])).toBeNear(sphereColor(2), 4); // what looks at the viewer is as it was captured
      expect(shaded.at([0.2 - 0.9 * RADIUS, 0, 0])[1]).toBeLessThan(0.95 * sphereColor(2)[1]!); // and what is away from the lamp darker
      expect(clay.at([0.2, 0, 0])).toBeNear(trackColor(0).map((value) => 255 * value), 2);
    });

    test("are on the GPU as long as what has them, edges or not", async () => {
      const [group, floor, lone] = [makeGroup({ isColored: true }).packed, makeFloor(6, true).packed, makeGroup({ track: 1, squareFrame: -1 }).packed];
      const bytes = [group, floor, lone].map(({ texels, colors, faces }) => texels.byteLength + (colors?.byteLength ?? 0) + faces.byteLength);
      expect((await numbers()).gpuBytes).toBe(bytes.reduce((a, b) => a + b, group.extra.byteLength));
      await looking("color", 2);
      const plain = await numbers();
      await looking("wireframe", 2);
      expect((await numbers()).textures).toBe(plain.textures + 2); // of the floor
      await looking("color", 2);
      expect(await numbers()).toMatchObject({ gpuBytes: plain.gpuBytes, textures: plain.textures, geometries: plain.geometries });
      await open.page.evaluate(() => window.api.release());
      expect((await numbers()).gpuBytes).toBe(0);
    });
  });

  describe("textures", () => {
    const striped = async (distance: number, stripe: number, colors: readonly [string, string]): Promise<Picture> => {
      await look("color");
      await open.page.evaluate((far) => window.api.camera(0, far, 1e-3), distance);
      await open.page.evaluate(([size, both]) => window.api.showStriped(1024, size, both), [stripe, colors] as const);
      return picture();
    };
    /** Greens of the row of pixels through the middle, where the floor is. */
    const row = (drawn: Picture): number[] =>
      Array.from({ length: 200 }, (_, k) => drawn.at([(k - 100) / 100, 0, 0])).filter((color) => color[0] !== 255).map(([, green]) => green);

    test("are the colours of their picture, to the byte", async () => {
      const drawn = await striped(3, 1024, ["rgb(200, 100, 50)", "black"]);
      expect(drawn.at([0, 0, 0])).toBeNear([200, 100, 50], 1);
    });

    test("are looked at in three smaller sizes and no more: beyond, their charts would run into each other", async () => {
      const kept = row(await striped(19, 16, ["rgb(200, 0, 0)", "rgb(200, 255, 0)"])); // a texel of the third is eight wide
      expect(kept.length).toBeGreaterThan(20);
      expect(Math.max(...kept) - Math.min(...kept)).toBeGreaterThan(150);
      const merged = row(await striped(19, 4, ["rgb(200, 0, 0)", "rgb(200, 255, 0)"]));
      expect(Math.max(...merged) - Math.min(...merged)).toBeLessThan(10);
    });
  });

  test("what it shows later costs no upload", async () => {
    await prepare(true);
    await show(0); // the materials of a first track are made with its first picture
    await picture();
    const uploads = await open.page.evaluate(() => [0, 1, 2, 3].flatMap((t) => window.api.uploadsWhileShowing(t)));
    expect(uploads).toEqual([]);
  });

  test("a value that was prepared costs no upload with its first picture", async () => {
    await prepare(true);
    expect(await open.page.evaluate(() => window.api.uploadsWhileShowing(2))).toEqual([]);
  });

  test("edges are made for the mode that draws them, and freed after it", async () => {
    await prepare(true);
    await show(2);
    await picture();
    const plain = await numbers();
    await look("wireframe");
    await show(2);
    await picture();
    const edged = await numbers();
    expect(edged.gpuBytes).toBeGreaterThan(plain.gpuBytes);
    expect(edged.drawn).toBe(plain.drawn);
    await look("shaded");
    await show(2);
    await picture();
    const after = await numbers();
    expect([after.gpuBytes, after.geometries, after.textures]).toEqual([plain.gpuBytes, plain.geometries, plain.textures]);
  });

  test("release frees all that a value had", async () => {
    const before = await numbers();
    await prepare(true, true);
    const expected = [makeGroup().packed, makeGroup({ track: 1, squareFrame: -1 }).packed, makeFloor().packed];
    const bytes = expected.map((packed) => packed.texels.byteLength + packed.faces.byteLength + (packed.kind === "group" ? packed.extra.byteLength : 0));
    expect((await numbers()).gpuBytes).toBe(bytes.reduce((a, b) => a + b));
    for (let round = 0; round < 3; round++) {
      await prepare(true, true);
      await show(2);
      expect((await picture()).covered()).toBeGreaterThan(0.1);
      await open.page.evaluate(() => window.api.release());
    }
    expect((await picture()).covered()).toBe(0);
    await open.page.evaluate(() => window.api.renew());
    const after = await numbers();
    expect(after.gpuBytes).toBe(0);
    expect([after.textures, after.geometries]).toEqual([before.textures, before.geometries]);
  });

  test("forty values that come and go leave nothing, whatever the mode", async () => {
    const round = (count: number): Promise<void> =>
      open.page.evaluate((k) => {
        window.api.prepare(true);
        window.api.look(k % 2 ? "wireframe" : "shaded");
        window.api.show(k % 4);
        window.api.draw();
        window.api.release();
      }, count);
    for (const count of [0, 1]) await round(count);
    const before = await numbers();
    for (let count = 0; count < 40; count++) await round(count);
    const after = await numbers();
    expect([after.gpuBytes, after.textures, after.geometries]).toEqual([0, before.textures, before.geometries]);
  });

  test("a lost context comes back with the same picture", async () => {
    await open.page.evaluate(() => window.api.prepareColored());
    await look("color");
    await show(2);
    const before = await picture();
    await open.page.evaluate(() => window.api.loseContext());
    expect(await open.page.evaluate(() => window.api.uploadsWhileShowing(2))).toEqual([]); // all is there again already
    const after = await picture();
    expect(after.difference(before)).toBe(0);
    expect(after.covered()).toBeGreaterThan(0.2);
    await open.page.evaluate(() => window.api.release());
    expect((await numbers()).gpuBytes).toBe(0);
  });

  test("a texture that the GPU cannot hold is refused with its size", async () => {
    const message = await open.page.evaluate(() => window.api.refuse());
    expect(message).toMatch(/group of chunk 7: a texture of 1000000 x 1, the GPU's largest is \d+/);
  });
});
