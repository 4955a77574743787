// What viewers do beyond playing: flying, turning, repeating a part, counting frames, sending links.

import { execFileSync } from "node:child_process";
import { join } from "node:path";

import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, PYTHON, ROOT } from "../../test/python.ts";
import { Site } from "./product.ts";

describeInBrowser("the page of a recording", () => {
  const site = new Site();
  beforeAll(() => site.open(), 120_000);
  afterAll(() => site.close());

  const visit = async (rest: string): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?src=/layers.reel${rest}`);
    await found.page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    return found;
  };
  const camera = (page: Page): Promise<number[]> => page.evaluate(() => document.querySelector("meshreel-player")!.camera.split(",").map(Number));

  /** Return the camera when ten frames leave it where it is: a page that gets another size moves it in several. */
  async function settled(page: Page): Promise<number[]> {
    const tenFrames = (): Promise<void> =>
      new Promise((done) => {
        const next = (left: number): unknown => (left ? requestAnimationFrame(() => next(left - 1)) : done());
        next(10);
      });
    for (let last = ""; ; ) {
      await page.evaluate(tenFrames);
      const now = await camera(page);
      if (now.join() === last) return now;
      last = now.join();
    }
  }
  const hash = (page: Page): Promise<string> => page.evaluate(() => decodeURIComponent(location.hash));

  test("its address follows time, camera and shading, and opens the same again", async () => {
    const { page, errors } = await visit("");
    expect(await hash(page)).toBe("");
    await page.keyboard.press("End");
    await page.keyboard.press("m");
    await page.keyboard.press("Shift+ArrowLeft");
    await expect.poll(() => hash(page)).toMatch(/^#t=[\d.]+&mode=normal&camera=[-\d.,]+$/);
    const [address, wanted] = [page.url(), await camera(page)];
    const state = () => document.querySelector("meshreel-player")!.currentFrame + document.querySelector("meshreel-player")!.mode;
    const seen = await page.evaluate(state);
    const again = await site.visit(address);
    await expect.poll(() => again.page.evaluate(state)).toBe(seen);
    await expect.poll(() => camera(again.page)).toEqual(wanted);
    await again.page.evaluate(() => void (location.hash = "t=0&mode=tracks"));
    await expect.poll(() => again.page.evaluate(() => document.querySelector("meshreel-player")!.mode)).toBe("tracks");
    expect([...errors, ...again.errors]).toEqual([]);
    await again.page.close();
    await page.close();
  });

  test("an address that is typed while its own is due stays", async () => {
    const { page, errors } = await visit("");
    await page.keyboard.press("End");
    await expect.poll(() => hash(page)).toMatch(/^#t=[\d.]+$/);
    await page.keyboard.press("m");
    await page.evaluate(() => {
      setTimeout(() => void (location.hash = "mode=tracks"), 400); // the page's own timer, begun after it, is due beside it
      document.querySelector("meshreel-player")!.dispatchEvent(new Event("camerachange"));
      for (const end = performance.now() + 600; performance.now() < end; );
    });
    await expect.poll(() => page.evaluate(() => document.querySelector("meshreel-player")!.mode)).toBe("tracks");
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a link to what is seen is copied", async () => {
    const { page } = await visit("&t=0.04");
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await page.locator("button.more").click();
    await page.locator(".settings button.share").click();
    await page.locator(".toast").getByText("Link copied").waitFor();
    expect(await page.evaluate(() => navigator.clipboard.readText())).toMatch(/layers\.reel&t=0\.04#t=0\.040$/);
    await page.close();
  });

  test.skipIf(!hasPython)("it begins with the file's view, unless the address has another, and copies the command for the view of now", async () => {
    const tagged = join(site.folder, "tagged.reel");
    const numbers = [0.5, 0.7, -4, 0.5, 0.6, 0, 30];
    execFileSync(PYTHON, ["-m", "meshreel", "tag", "conformance/v1/layers.reel", `--view=${numbers.join(",")}`, "-o", tagged], { cwd: ROOT });
    const open = async (rest: string): Promise<Page> => {
      const { page } = await site.visit(`player/index.html?src=/tagged.reel${rest}`);
      await page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
      return page;
    };
    const page = await open("");
    const told = (): Promise<number[]> => page.evaluate(() => document.querySelector("meshreel-player")!.viewOfFile.split(",").map(Number));
    const isAsTagged = async (): Promise<void> => (await told()).forEach((value, k) => expect(value).toBeCloseTo(numbers[k], 3));
    await isAsTagged();
    const wide = await camera(page);
    await page.setViewportSize({ width: 800, height: 240 });
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.shadowRoot!.querySelector("canvas")!.clientWidth === 800);
    await isAsTagged();
    await page.setViewportSize({ width: 300, height: 600 }); // from farther away, but the same view
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.shadowRoot!.querySelector("canvas")!.clientWidth === 300);
    await expect.poll(() => camera(page)).not.toEqual(wide);
    await expect.poll(() => page.evaluate(() => document.querySelector("meshreel-player")!.cameraMoved)).toBe(false);
    await isAsTagged();
    const before = await settled(page);
    await page.keyboard.press("0"); // all of it
    await expect.poll(() => camera(page)).not.toEqual(before);
    await page.keyboard.press("0");
    await expect.poll(() => camera(page)).toEqual(before);
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await page.locator("button.more").click();
    await page.locator(".settings button.view").click();
    await page.locator(".toast").getByText("Command copied").waitFor();
    const command = await page.evaluate(() => navigator.clipboard.readText());
    expect(command).toMatch(/^meshreel tag tagged\.reel --view=[-\d.,]+,30 -o view-tagged\.reel$/);
    await page.close();
    const other = await open("#camera=1,2,3,0,0,0");
    expect(await camera(other)).toEqual([1, 2, 3, 0, 0, 0]);
    await other.close();
  });

  test("a part is repeated, and marked on the bar", async () => {
    const { page, errors } = await visit("&speed=0.5&section=0.1,0.25");
    await page.keyboard.press("k");
    const times = await page.evaluate(async () => {
      const player = document.querySelector("meshreel-player")!;
      const seen: number[] = [];
      for (let repeats = 0; repeats < 2; ) {
        await new Promise((done) => setTimeout(done, 15));
        if (player.currentTime < (seen.at(-1) ?? 0)) repeats++;
        seen.push(player.currentTime);
      }
      return seen;
    });
    expect(Math.max(...times)).toBeLessThan(0.4);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.paused)).toBe(false);
    expect((await page.locator(".section").boundingBox())!.width).toBeGreaterThan(10);
    await page.keyboard.press("\\");
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.section)).toBe(null);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("it plays backwards, there and back, and a part backwards", async () => {
    const { page, errors } = await visit("&loop&direction=reverse");
    await page.keyboard.press("k");
    /** The turns and jumps until there are so many, and the times between which it was; how much it moved each way. */
    const watch = (count: number) => page.evaluate(async (most) => {
      const player = document.querySelector("meshreel-player")!;
      let [last, turns, up, down, way] = [player.currentTime, 0, 0, 0, 0];
      const range = [last, last];
      while (turns < most) {
        await new Promise((done) => requestAnimationFrame(done));
        const moved = player.currentTime - last;
        last += moved;
        if (moved > 0) up += moved;
        else down -= moved;
        if (moved * way < 0) turns++;
        if (moved !== 0) way = Math.sign(moved);
        range.splice(0, 2, Math.min(range[0]!, last), Math.max(range[1]!, last));
      }
      return { range, up, down, jumps: way };
    }, count);
    const { duration } = await page.evaluate(() => ({ duration: document.querySelector("meshreel-player")!.duration }));
    const reverse = await watch(4); // down, a jump up, down, a jump up, down
    expect([reverse.up / duration > 1.2, reverse.range[0]! < 0.2 * duration, reverse.range[1]! > 0.8 * duration]).toEqual([true, true, true]);
    await page.evaluate(() => void (document.querySelector("meshreel-player")!.section = [0.1, 0.25]));
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.currentTime < 0.26); // it is there
    const part = await watch(4);
    expect([part.range[0]! > 0, part.range[1]! < 0.3]).toEqual([true, true]);
    await page.evaluate(() => Object.assign(document.querySelector("meshreel-player")!, { section: null, direction: "alternate" }));
    const both = await watch(3);
    expect(Math.min(both.up, both.down)).toBeGreaterThan(0.5 * duration);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.skippedGroups)).toBe(0);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("the keys [ and ] set where a part begins and ends, N counts frames", async () => {
    const { page } = await visit("");
    const section = () => page.evaluate(() => document.querySelector("meshreel-player")!.section);
    const duration = await page.evaluate(() => document.querySelector("meshreel-player")!.duration);
    await page.keyboard.press("[");
    expect(await section()).toEqual([0, Number(duration.toFixed(3))]);
    await page.keyboard.press(".");
    await page.keyboard.press("]");
    const [from, to] = (await section())!;
    expect([from, to > 0 && to < duration]).toEqual([0, true]);
    await page.keyboard.press("n");
    await expect.poll(() => page.locator(".time").textContent()).toMatch(/^2 \/ \d+$/);
    await page.close();
  });

  test("G flies: W goes where the camera looks, a drag looks around from there, and S is no key of the statistics", async () => {
    const { page, errors } = await visit("");
    const [before] = [await camera(page)];
    await page.keyboard.press("g");
    await page.keyboard.down("w");
    const moved = async (): Promise<number> => Math.hypot(...(await camera(page)).slice(0, 3).map((value, k) => value - before[k]!));
    await expect.poll(moved).toBeGreaterThan(0.01);
    await page.keyboard.up("w");
    const after = await camera(page);
    const towards = before.slice(3).map((value, k) => value - before[k]!);
    const went = after.slice(0, 3).map((value, k) => value - before[k]!);
    const cosine = went.reduce((sum, value, k) => sum + value * towards[k]!, 0) / (Math.hypot(...went) * Math.hypot(...towards));
    expect(Math.hypot(...went)).toBeGreaterThan(0.01);
    expect(cosine).toBeGreaterThan(0.999);
    await page.mouse.move(160, 80);
    await page.mouse.down();
    await page.mouse.move(220, 90, { steps: 4 });
    await page.mouse.up();
    const turned = await camera(page);
    expect(turned.slice(0, 3)).toEqual(after.slice(0, 3));
    expect(turned.slice(3)).not.toEqual(after.slice(3));
    await page.keyboard.press("s");
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.stats)).toBe(false);
    await page.keyboard.press("g");
    await page.keyboard.press("s");
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.stats)).toBe(true);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a recording opens so that its box fills the picture above the bar in one direction, with the same small margins above and below", async () => {
    const { page, errors } = await visit("");
    const bounds = (): Promise<number[]> =>
      page.evaluate(() => {
        const player = document.querySelector("meshreel-player")!;
        const { minimum, size } = player.info!.box;
        const [eye, target] = [player.camera.split(",").slice(0, 3).map(Number), player.camera.split(",").slice(3).map(Number)];
        const unit = (v: number[]): number[] => v.map((value) => value / Math.hypot(...v));
        const dot = (u: number[], v: number[]): number => u.reduce((sum, value, k) => sum + value * v[k]!, 0);
        const back = unit(eye.map((value, k) => value - target[k]!));
        const aside = unit([back[2]!, 0, -back[0]!]);
        const up = [back[1]! * aside[2]! - back[2]! * aside[1]!, back[2]! * aside[0]! - back[0]! * aside[2]!, back[0]! * aside[1]! - back[1]! * aside[0]!];
        const bar = player.shadowRoot!.querySelector<HTMLElement>(".bar")!.offsetHeight;
        const focal = player.clientHeight / 2 / Math.tan(Math.PI / 8); // pixels
        const seen = Array.from({ length: 8 }, (_, k) => {
          const from = eye.map((value, axis) => minimum[axis]! + ((k >> axis) & 1) * size[axis]! - value);
          return [(focal * dot(from, aside)) / -dot(from, back), (focal * dot(from, up)) / -dot(from, back)];
        });
        const of = (axis: number): number[] => seen.map((place) => place[axis]!);
        const [wide, high] = [player.clientWidth / 2, (player.clientHeight - bar) / 2];
        return [Math.min(...of(0)) / wide, Math.max(...of(0)) / wide, Math.min(...of(1)) / high, Math.max(...of(1)) / high];
      });
    for (const [width, height] of [[320, 480], [400, 400], [640, 360]] as const) {
      await page.setViewportSize({ width, height });
      const most = async (): Promise<number> => Math.max(...(await bounds()).map(Math.abs));
      await expect.poll(most).toBeCloseTo(1 / 1.05, 2); // it fills one of them
      const [, , below, above] = await bounds();
      expect(-below!).toBeCloseTo(above!, 1);
    }
    expect(errors).toEqual([]);
    await page.close();
  });

  test("without three.js an error says what is missing", async () => {
    const page = await site.browser.newPage();
    await page.route("**/three.js*", (route) => route.abort());
    await page.goto(new URL("player/index.html?src=/layers.reel", site.served.url).href);
    await page.getByRole("alert").waitFor();
    expect(await page.getByRole("alert").textContent()).toMatch(/player\/three\.js cannot be loaded/);
    await page.close();
  });

  test("it turns by itself, but not for viewers who prefer less motion", async () => {
    const { page } = await visit("&autorotate");
    const before = await camera(page);
    await expect.poll(async () => (await camera(page))[0]).not.toBe(before[0]);
    await page.emulateMedia({ reducedMotion: "reduce" });
    await page.evaluate(() => void (document.querySelector("meshreel-player")!.autoRotate = false));
    await page.evaluate(() => void (document.querySelector("meshreel-player")!.autoRotate = true));
    await page.waitForTimeout(1500); // until it has come to rest
    const still = await camera(page);
    await page.waitForTimeout(500);
    expect(await camera(page)).toEqual(still);
    await page.close();
  });
});
