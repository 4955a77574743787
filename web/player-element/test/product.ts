// The built player in a folder of a web server, as users have it.

import { createHash } from "node:crypto";
import { copyFileSync, cpSync, existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, renameSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { build } from "vite";
import { launchBrowser, serveFolder, type Served } from "../../test/browser.ts";
import { ENTRIES } from "../../vite.config.ts";

const ROOT = fileURLToPath(new URL("../../../", import.meta.url));
const WEB = join(ROOT, "web");
const CORE = join(ROOT, "src/meshreel/player/core.wasm");
const DAY = 86_400_000; // ms

/** Builds the player into `folder`, with the core.wasm that is committed. */
export async function buildPlayer(folder: string): Promise<void> {
  mkdirSync(folder, { recursive: true });
  copyFileSync(CORE, join(folder, "core.wasm"));
  process.env.MESHREEL_PLAYER = folder;
  for (const mode of Object.keys(ENTRIES)) await build({ configFile: join(WEB, "vite.config.ts"), mode, logLevel: "error" });
}

/** The player of these sources, in a folder that is never changed: built once for all tests, and for later runs. */
async function builtPlayer(): Promise<string> {
  const digest = createHash("sha256");
  for (const path of sources()) digest.update(path).update("\0").update(readFileSync(path)).update("\0");
  const all = join(ROOT, "build/tests/player");
  const kept = join(all, digest.digest("hex").slice(0, 16));
  if (existsSync(kept)) return kept;
  mkdirSync(all, { recursive: true });
  for (const old of readdirSync(all).map((name) => join(all, name))) if (Date.now() - statSync(old).mtimeMs > DAY) rmSync(old, { recursive: true, force: true });
  const made = mkdtempSync(`${kept}-`);
  await buildPlayer(made);
  try {
    renameSync(made, kept);
  } catch {
    rmSync(made, { recursive: true }); // another worker was first
  }
  return kept;
}

/** What the player is built from. */
function sources(): string[] {
  const places = readdirSync(WEB).flatMap((name) => [join(WEB, name, "src"), join(WEB, name, "page")]).filter(existsSync);
  const files = places.flatMap((place) => readdirSync(place, { recursive: true, encoding: "utf8" }).sort().map((name) => join(place, name)));
  return [CORE, ...["package-lock.json", "vite.config.ts"].map((name) => join(WEB, name)), ...files.filter((path) => statSync(path).isFile())];
}

/** A site with `player/` and the conformance files; pages are added to it. */
export class Site {
  readonly folder = mkdtempSync(join(tmpdir(), "meshreel-site-"));
  browser!: Browser;
  served!: Served;
  #others: Served[] = [];

  async open(): Promise<void> {
    cpSync(await builtPlayer(), join(this.folder, "player"), { recursive: true });
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
