// Headless Chromium for tests: finds it, bundles a page for it, serves a folder to it. Tests are skipped, with the reason in
// their name, where there is none.

import { accessSync, constants, createReadStream, mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import type { IncomingMessage, ServerResponse } from "node:http";
import type { AddressInfo } from "node:net";
import { tmpdir } from "node:os";
import { delimiter, dirname, extname, join, resolve, sep } from "node:path";
import { chromium } from "playwright-core";
import type { Browser, Page } from "playwright-core";
import { build } from "vite";
import { describe } from "vitest";

const NAMES = ["chromium", "chromium-browser", "google-chrome"];

/** The rest of Chromium is quiet, and WebGL is drawn by software, so that every machine draws the same. */
const FLAGS = [
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--disable-quic",
];

const TYPES: Readonly<Record<string, string>> = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".css": "text/css",
  ".json": "application/json",
  ".svg": "image/svg+xml",
  ".png": "image/png",
  ".wasm": "application/wasm",
  ".reel": "application/octet-stream",
};

/** Chromium's path: CHROMIUM in the environment, else the first of its names on PATH; null where there is none. */
export function findChromium(): string | null {
  const named = process.env.CHROMIUM;
  if (named) return named;
  const endings = process.platform === "win32" ? [".exe"] : [""];
  for (const name of NAMES) {
    for (const folder of (process.env.PATH ?? "").split(delimiter)) {
      for (const ending of endings) {
        const path = join(folder, name + ending);
        if (folder !== "" && isExecutable(path)) return path;
      }
    }
  }
  return null;
}

/** A `describe` whose tests need Chromium. */
export function describeInBrowser(name: string, body: () => void): void {
  if (findChromium() !== null) describe(name, body);
  else describe.skip(`${name} (skipped: no chromium; set CHROMIUM to the path of one)`, body);
}

/** Starts Chromium with an empty profile of its own. Error where there is none. */
export async function launchBrowser(flags: readonly string[] = []): Promise<Browser> {
  const executablePath = findChromium();
  if (executablePath === null) throw new Error(`no chromium: none of ${NAMES.join(", ")} is on PATH; set CHROMIUM to one`);
  return chromium.launch({ executablePath, args: [...FLAGS, ...flags] });
}

export interface Served {
  readonly url: string; // of the folder, with a slash at its end
  close(): Promise<void>;
}

/** Serves the files of a folder, and no others, on a free port of this machine. `headers` go with every answer. */
export async function serveFolder(folder: string, headers: Readonly<Record<string, string>> = {}): Promise<Served> {
  const root = resolve(folder);
  const server = createServer((request, response) => answer(root, headers, request, response));
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  const { port } = server.address() as AddressInfo;
  return {
    url: `http://127.0.0.1:${port}/`,
    close: () =>
      new Promise((done) => {
        server.close(() => done());
        server.closeAllConnections();
      }),
  };
}

/** Headers that give a page clocks of 5 microseconds instead of 100. */
export const ISOLATED = {
  "Cross-Origin-Opener-Policy": "same-origin",
  "Cross-Origin-Embedder-Policy": "require-corp",
} as const;

/** Bundles a TypeScript module and a page that runs it, as index.html, into a new temporary folder. */
export async function bundlePage(entry: string): Promise<string> {
  const folder = mkdtempSync(join(tmpdir(), "meshreel-page-"));
  await build({
    configFile: false,
    root: dirname(resolve(entry)),
    base: "./",
    logLevel: "error",
    publicDir: false,
    build: {
      outDir: folder,
      target: "es2022",
      minify: false,
      rolldownOptions: { input: resolve(entry), output: { entryFileNames: "page.js" } },
    },
  });
  const page = '<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><body style="margin:0"><script type="module" src="page.js"></script>';
  writeFileSync(join(folder, "index.html"), page);
  return folder;
}

export interface OpenPage {
  readonly page: Page;
  readonly url: string;
  /** What the page threw or logged as errors, so far. */
  readonly errors: string[];
  close(): Promise<void>;
}

/** Bundles, serves and opens a module's page in a Chromium of its own. */
export async function openPage(entry: string, flags: readonly string[] = []): Promise<OpenPage> {
  return openFolder(await bundlePage(entry), flags);
}

/** Opens an empty page in a Chromium of its own: a page that this machine serves has WebCodecs. */
export async function openEmptyPage(): Promise<OpenPage> {
  const folder = mkdtempSync(join(tmpdir(), "meshreel-page-"));
  writeFileSync(join(folder, "index.html"), '<!doctype html><link rel="icon" href="data:,">');
  return openFolder(folder, []);
}

async function openFolder(folder: string, flags: readonly string[]): Promise<OpenPage> {
  const served = await serveFolder(folder, ISOLATED);
  const browser = await launchBrowser(flags);
  const page = await browser.newPage();
  const errors: string[] = [];
  page.on("pageerror", (error) => errors.push(error.stack ?? String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  await page.goto(served.url);
  const close = async (): Promise<void> => {
    await browser.close();
    await served.close();
    rmSync(folder, { recursive: true, force: true });
  };
  return { page, url: served.url, errors, close };
}

function isExecutable(path: string): boolean {
  try {
    accessSync(path, constants.X_OK);
    return statSync(path).isFile();
  } catch {
    return false;
  }
}

function answer(root: string, headers: Readonly<Record<string, string>>, request: IncomingMessage, response: ServerResponse): void {
  const { pathname } = new URL(request.url ?? "/", "http://localhost");
  const path = resolve(root, `.${decodeURIComponent(pathname.endsWith("/") ? `${pathname}index.html` : pathname)}`);
  const inside = path.startsWith(root + sep);
  if (!inside || !statSync(path, { throwIfNoEntry: false })?.isFile()) {
    response.writeHead(404, headers).end();
    return;
  }
  response.writeHead(200, { ...headers, "Content-Type": TYPES[extname(path)] ?? "application/octet-stream", "Cache-Control": "no-store" });
  createReadStream(path).pipe(response);
}
