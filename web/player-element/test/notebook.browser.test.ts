// What Python shows in a notebook, and the page that `video.show()` opens: the player with the file in it, without a network.

import { execFileSync } from "node:child_process";
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

import type { Frame } from "playwright-core";
import { expect, test } from "vitest";

import { describeInBrowser, launchBrowser, serveFolder } from "../../test/browser.ts";
import { hasPython, PYTHON, ROOT, runPython } from "../../test/python.ts";

const RECORDING = join(ROOT, process.env.RECORDING ?? "conformance/v1/scene.reel");

function canRun(): boolean {
  try {
    execFileSync(PYTHON, ["-c", "import nbconvert, ipykernel"], { stdio: "ignore" });
    return true;
  } catch {
    return false;
  }
}

async function plays(frame: Frame): Promise<number> {
  await frame.waitForFunction(() => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0, null, { timeout: 60_000 });
  return frame.evaluate(async () => {
    const player = document.querySelector("meshreel-player")!;
    await player.play();
    const end = new Promise((done) => player.addEventListener("timeupdate", () => player.currentFrame > 2 && done(null)));
    await end;
    return player.info!.frameCount;
  });
}

const ready = hasPython && canRun();

describeInBrowser(`a notebook${ready ? "" : " (skipped: no nbconvert and ipykernel in .venv)"}`, () => {
  test.skipIf(!ready)("plays a video in its output, and shows a mesh; a page on disk plays too", async () => {
    const folder = mkdtempSync(join(tmpdir(), "meshreel-notebook-"));
    runPython(new URL("notebook.py", import.meta.url), RECORDING, folder);
    const [served, browser] = [await serveFolder(folder), await launchBrowser()];
    try {
      const page = await browser.newPage({ viewport: { width: 1000, height: 1400 } });
      const asked: string[] = [];
      await page.goto(`${served.url}notebook.html`, { waitUntil: "domcontentloaded" });
      page.on("request", (request) => asked.push(request.url()));
      await page.waitForFunction(() => document.querySelectorAll("iframe").length === 2 && [...document.querySelectorAll("iframe")].every((frame) => frame.contentDocument?.readyState === "complete"));
      const frames = page.frames().filter((frame) => frame.url() === "about:srcdoc");
      expect(frames.length).toBe(2); // of the cell's value, and of show()
      for (const frame of frames) expect(await plays(frame)).toBeGreaterThan(2);
      const picture = await page.locator("img[src^='data:image/png']").evaluate((image: HTMLImageElement) => [image.naturalWidth, image.naturalHeight]);
      expect(picture).toEqual([400, 300]);
      if (process.env.SCREENSHOT) await page.screenshot({ path: process.env.SCREENSHOT });
      expect(asked.filter((url) => url.startsWith(served.url))).toEqual([]);

      const alone = await browser.newPage();
      await alone.goto(pathToFileURL(join(folder, "page.html")).href);
      expect(await plays(alone.mainFrame())).toBeGreaterThan(2);
    } finally {
      await browser.close();
      await served.close();
    }
  }, 180_000);
});

