// A page of players on fakes, and what tests do with it.

import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, beforeEach, expect, test } from "vitest";
import { describeInBrowser, openPage, type OpenPage } from "../../test/browser.ts";
import type { MeshreelPlayer } from "../src/element.ts";
import type { FakeEngine } from "./fake.ts";

const PAGE = fileURLToPath(new URL("./page_fake.ts", import.meta.url));

declare global {
  const engine: FakeEngine; // of the page
}

/** What the tests of a file share: one browser, one page. */
export class Fixture {
  open!: OpenPage;

  get page(): Page {
    return this.open.page;
  }

  /** Puts this markup into an empty page and waits until what it opens is ready. */
  async put(markup: string, ready = true): Promise<void> {
    await this.page.evaluate(async (html) => {
      document.body.replaceChildren();
      document.body.innerHTML = html;
      await new Promise((done) => setTimeout(done));
      engine.playbacks = engine.playbacks.filter((playback) => !playback.disposed);
      engine.stages = engine.stages.filter((stage) => !stage.disposed);
    }, markup);
    if (ready) await this.eventually((player) => player.readyState === 4);
  }

  shown(attributes = ""): Promise<void> {
    return this.put(`<meshreel-player src="walk.reel" controls ${attributes}></meshreel-player>`);
  }

  /** What a function says of the first player; it runs in the page. */
  get<T>(read: (player: MeshreelPlayer) => T): Promise<Awaited<T>> {
    return this.page.evaluate(`(${read.toString()})(document.querySelector("meshreel-player"))`);
  }

  async eventually(read: (player: MeshreelPlayer) => boolean): Promise<void> {
    await this.page.waitForFunction(`(${read.toString()})(document.querySelector("meshreel-player"))`, undefined, { timeout: 5000 });
  }

  /** Presses a key while the picture has the focus. */
  async press(key: string): Promise<void> {
    await this.page.locator(".picture").focus();
    await this.page.keyboard.press(key);
  }
}

/** Tests in one page; the last of them asks that nothing was thrown or logged as an error. */
export function describeOnPage(name: string, body: (fixture: Fixture) => void): void {
  describeInBrowser(name, () => {
    const fixture = new Fixture();
    beforeAll(async () => {
      fixture.open = await openPage(PAGE);
    }, 60_000);
    afterAll(() => fixture.open?.close());
    beforeEach(async () => {
      await fixture.page.emulateMedia({ colorScheme: "dark", reducedMotion: "no-preference" });
      await fixture.page.setViewportSize({ width: 800, height: 500 });
    });
    body(fixture);
    test("nothing was thrown and nothing was logged as an error", () => {
      expect(fixture.open.errors).toEqual([]);
    });
  });
}
