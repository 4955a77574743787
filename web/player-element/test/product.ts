// The built player in a folder of a web server, as users have it.

import { copyFileSync, cpSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { build } from "vite";
import { launchBrowser, serveFolder, type Served } from "../../test/browser.ts";
import { ENTRIES } from "../../vite.config.ts";

const ROOT = fileURLToPath(new URL("../../../", import.meta.url));

/** Builds the player into `folder`, with the core.wasm that is committed. */
export async function buildPlayer(folder: string): Promise<void> {
  mkdirSync(folder, { recursive: true });
  copyFileSync(join(ROOT, "src/meshreel/player/core.wasm"), join(folder, "core.wasm"));
  process.env.MESHREEL_PLAYER = folder;
  for (const mode of Object.keys(ENTRIES)) await build({ configFile: join(ROOT, "web/vite.config.ts"), mode, logLevel: "error" });
}

/** A site with `player/` and the conformance files; pages are added to it. */
export class Site {
  readonly folder = mkdtempSync(join(tmpdir(), "meshreel-site-"));
  browser!: Browser;
  served!: Served;
  #others: Served[] = [];

  async open(): Promise<void> {
    await buildPlayer(join(this.folder, "player"));
    for (const name of ["scene", "layers", "mixed", "laplacian", "draco"]) {
      copyFileSync(join(ROOT, `conformance/v1/${name}.reel`), join(this.folder, `${name}.reel`));
    }
    this.served = await serveFolder(this.folder);
    this.browser = await launchBrowser();
  }

  write(name: string, text: string | Uint8Array): void {
    writeFileSync(join(this.folder, name), text);
  }

  /** The same folder from another origin, with these headers. */
  async serveAgain(headers: Readonly<Record<string, string>>): Promise<string> {
    const served = await serveFolder(this.folder, headers);
    this.#others.push(served);
    return served.url;
  }

  /** A new page at a path of the site, or at a whole address, in which these scripts run first; its errors are collected. */
  async visit(path: string, scripts: readonly Parameters<Page["addInitScript"]>[0][] = []): Promise<{ page: Page; errors: string[] }> {
    const page = await this.browser.newPage({ viewport: { width: 320, height: 240 } });
    for (const script of scripts) await page.addInitScript(script);
    const errors: string[] = [];
    page.on("pageerror", (error) => errors.push(error.stack ?? String(error)));
    page.on("console", (message) => {
      if (message.type() === "error") errors.push(message.text());
    });
    await page.goto(new URL(path, this.served.url).href);
    return { page, errors };
  }

  copyPlayer(to: string): void {
    cpSync(join(this.folder, "player"), join(this.folder, to), { recursive: true });
  }

  async close(): Promise<void> {
    await this.browser?.close();
    for (const served of [this.served, ...this.#others]) await served?.close();
    rmSync(this.folder, { recursive: true, force: true });
  }
}
