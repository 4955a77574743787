// What is heard is in step with what is seen: a recording of 4 s with a tone, in the built player.

import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, PYTHON, ROOT, runModule } from "../../test/python.ts";
import type { MeshreelPlayer } from "../src/element.ts";
import { Site } from "./product.ts";

const DRIFT = 0.06; // s, at most
const [PICTURES, LONGEST] = [40, 3000]; // that are looked at, and for how many ms
/** Files by name: when their tone begins, and how long it is, s. */
const FILES = { long: [0, 6], short: [0.5, 1.5], early: [-2, 8] } as const;

interface Step {
  readonly worst: number; // s between what is heard and what is seen
  readonly count: number; // of pictures that moved while it was heard
}

describeInBrowser(`the sound of a recording${hasPython ? "" : " (skipped: no Python)"}`, () => {
  const site = new Site();
  beforeAll(async () => {
    await site.open();
    for (const [name, [start, seconds]] of Object.entries(FILES)) site.write(`${name}.reel`, runModule("tests.heard", start, seconds));
  }, 240_000);
  afterAll(() => site.close());

  const open = async (query: string): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?${query}`);
    await found.page.waitForFunction(() => document.querySelector("meshreel-player")!.readyState >= 2);
    return found;
  };
  const get = <T>(page: Page, read: (player: MeshreelPlayer) => T): Promise<Awaited<T>> =>
    page.evaluate(`(${read.toString()})(document.querySelector("meshreel-player"))`);
  /** What is between sound and picture, in some pictures. */
  const follow = (page: Page, start: number): Promise<Step> =>
    page.evaluate(async ([begin, pictures, time]) => {
      const player = document.querySelector("meshreel-player")!;
      const found = { worst: 0, count: 0 };
      const own = requestAnimationFrame;
      // The player moves its clock at the beginning of its callback.
      globalThis.requestAnimationFrame = (callback) => own((now) => {
        const [sound, before] = [player.audio?.paused === false ? player.audio.currentTime : NaN, player.currentTime];
        callback(now);
        if (Number.isNaN(sound) || player.currentTime === before || player.audio?.paused !== false) return;
        found.worst = Math.max(found.worst, Math.abs(sound + begin! - player.currentTime));
        found.count++;
      });
      for (const end = performance.now() + time!; performance.now() < end && found.count < pictures!; ) await new Promise((done) => setTimeout(done, 20));
      globalThis.requestAnimationFrame = own;
      return found;
    }, [start, PICTURES, LONGEST] as const);
  const heard = async (page: Page): Promise<void> => {
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.audio?.paused === false);
  };
  const inStep = async (page: Page, what: string, start = 0): Promise<void> => {
    await heard(page);
    const { worst, count } = await follow(page, start);
    if (process.env.MESHREEL_SAY) console.log(`${what}: ${(1000 * worst).toFixed(1)} ms in ${count} pictures`);
    expect(count, what).toBeGreaterThan(2);
    expect(worst, what).toBeLessThan(DRIFT);
  };

  test.runIf(hasPython)("stays in step while it plays, after seeks and pauses, at another speed, in loops and sections", async () => {
    const { page, errors } = await open("src=/long.reel&loop");
    await get(page, (player) => player.play());
    await inStep(page, "played");
    await get(page, (player) => void (player.currentTime = 0.4));
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.seeking);
    await inStep(page, "after a seek");
    await get(page, (player) => player.pause());
    const still = await get(page, (player) => [player.currentTime, player.audio!.currentTime]);
    await page.waitForTimeout(300);
    expect(await get(page, (player) => [player.currentTime, player.audio!.currentTime, player.audio!.paused])).toEqual([...still, true]);
    expect(Math.abs(still[0]! - still[1]!)).toBeLessThan(DRIFT);
    await get(page, (player) => void (player.currentTime = 1));
    await get(page, (player) => player.play());
    await inStep(page, "after a pause");
    await get(page, (player) => void (player.playbackRate = 2));
    await inStep(page, "at twice the speed");
    const before = await get(page, (player) => (player.currentTime = 3.5));
    await page.waitForFunction((from) => document.querySelector("meshreel-player")!.currentTime < from - 1, before);
    await inStep(page, "after a loop");
    await get(page, (player) => {
      player.playbackRate = 1;
      player.section = [1, 1.6];
    });
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.currentTime < 1.3);
    await inStep(page, "in a section");
    expect(errors).toEqual([]);
    await page.close();
  });

  test.runIf(hasPython)("begins later or earlier than the picture, and may end before it", async () => {
    const { page, errors } = await open("src=/short.reel");
    const whole = await get(page, (player) => {
      void player.play();
      return player.duration;
    });
    expect(whole).toBe(4);
    await inStep(page, "later", 0.5);
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.ended, undefined, { timeout: 10_000 });
    expect(await get(page, (player) => player.audio!.paused)).toBe(true);
    const from = performance.now();
    await get(page, (player) => player.play());
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.ended, undefined, { timeout: 10_000 });
    expect((performance.now() - from) / 1000).toBeGreaterThan(3.9); // it goes on where nothing is heard any more
    await get(page, (player) => void (player.src = "/early.reel"));
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.readyState >= 2);
    await get(page, (player) => player.play());
    await inStep(page, "earlier", -2);
    expect(errors).toEqual([]);
    await page.close();
  });

  test.runIf(hasPython)("is muted where the browser refuses it, and heard when the viewer asks for it", async () => {
    const tell = (): void => addEventListener("volumechange", () => setInterval(() => console.info("muted"), 100), true);
    const { page, errors } = await site.visit("player/index.html?src=/long.reel&autoplay&loop", [tell]);
    await page.waitForEvent("console", (message) => message.text() === "muted"); // to ask the page anything would count as a viewer's act
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.currentTime > 0.5);
    expect(await page.locator(".mute").getAttribute("aria-label")).toBe("Unmute");
    await page.setViewportSize({ width: 640, height: 360 });
    await page.mouse.move(100, 100); // the bar comes
    await page.locator(".mute").click();
    await inStep(page, "unmuted");
    await page.locator(".picture").focus();
    for (const key of ["ArrowDown", "ArrowDown", "u"]) await page.keyboard.press(key);
    expect(await get(page, (player) => [player.volume, player.muted])).toEqual([0.8, true]);
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.audio!.paused);
    await page.mouse.move(200, 100);
    await page.getByRole("slider", { name: "Volume" }).fill("0.5");
    expect(await get(page, (player) => [player.volume, player.muted])).toEqual([0.5, false]);
    await inStep(page, "louder");
    expect(errors).toEqual([]);
    await page.close();
  });

  test.runIf(hasPython)("is not fetched while it is muted, and asks for nothing where there is none", async () => {
    const { page, errors } = await open("src=/long.reel&muted&volume=0.3");
    await get(page, (player) => player.play());
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.currentTime > 0.3);
    expect(await get(page, (player) => [player.audio, player.volume, player.info!.hasAudio])).toEqual([null, 0.3, true]);
    await get(page, (player) => void (player.src = "/scene.reel"));
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.info?.size === 2854);
    expect(await page.locator(".mute").isVisible()).toBe(false);
    expect(errors).toEqual([]);
    await page.close();
  });

  test.runIf(hasPython)("that is damaged leaves the picture alone", async () => {
    const file = readFileSync(join(site.folder, "long.reel"));
    file[file.indexOf("OpusTags")]! ^= 1;
    site.write("damaged.reel", file);
    const { page } = await open("src=/damaged.reel&muted");
    const told = await page.evaluate(async () => {
      const player = document.querySelector("meshreel-player")!;
      const warning = new Promise<string>((done) => player.addEventListener("warning", (event) => done((event as CustomEvent<Error>).detail.message)));
      player.muted = false;
      await player.play();
      return warning;
    });
    expect(told).toMatch(/chunk \d+ \(audio\): layer 0 is damaged/);
    await page.waitForFunction(() => document.querySelector("meshreel-player")!.currentTime > 0.3);
    await page.close();
  });

  test.runIf(hasPython)("comes with a page that has the recording in itself", async () => {
    const path = join(site.folder, "page.html");
    const script = "import sys, meshreel; sys.stdout.write(meshreel.open(sys.argv[1])._page())";
    writeFileSync(path, execFileSync(PYTHON, ["-c", script, join(site.folder, "long.reel")], { cwd: ROOT, maxBuffer: 1 << 26 }));
    const { page, errors } = await site.visit(pathToFileURL(path).href);
    await page.waitForFunction(() => (document.querySelector("meshreel-player")?.readyState ?? 0) >= 2);
    await get(page, (player) => player.play());
    await inStep(page, "in a page");
    expect(errors).toEqual([]);
    await page.close();
  });
});
