// The packages as users get them: packed, installed from their tarballs into a project that has nothing else, typed, bundled by Vite, opened in a browser.
// The project's files are the examples of the packages' READMEs.

import { execFileSync, spawnSync } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Browser, Page } from "playwright-core";
import { createServer } from "vite";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser, launchBrowser, serveFolder } from "../../test/browser.ts";
import { ROOT } from "../../test/python.ts";
import { ALL } from "../../test/slow.ts";

const WEB = join(ROOT, "web");
const PAGES = ["index", "react", "three", "splats"];
const EXAMPLE = /```\w+ ([\w.]+)\n([\s\S]*?)```/g;
const versions = (JSON.parse(readFileSync(join(WEB, "package-lock.json"), "utf8")) as { packages: Record<string, { version: string }> }).packages;
const pinned = (name: string): string => `${name}@${versions[`node_modules/${name}`]!.version}`;

describeInBrowser(`the packages for npm${ALL ? "" : " (skipped: slow)"}`, () => {
  const folder = mkdtempSync(join(tmpdir(), "meshreel-npm-"));
  const project = join(folder, "project");
  const npm = (cwd: string, ...values: string[]): string => execFileSync("npm", values, { cwd, encoding: "utf8", shell: process.platform === "win32" });
  let browser: Browser;

  beforeAll(async () => {
    if (!ALL) return;
    execFileSync(process.execPath, [join(WEB, "npm.mjs"), folder], { env: { ...process.env, GITHUB_REPOSITORY: "owner/meshreel" } });
    const tarballs = ["meshreel-player", "meshreel-three"].map((name) => join(folder, npm(folder, "pack", "--silent", `./${name}`).trim()));
    for (const to of ["public", ""]) mkdirSync(join(project, to), { recursive: true });
    for (const name of ["meshreel-player", "meshreel-three"]) {
      for (const [, path, text] of readFileSync(join(WEB, name, "README.md"), "utf8").matchAll(EXAMPLE)) writeFileSync(join(project, path!), text!);
    }
    const page = (body: string): string => `<!doctype html><link rel="icon" href="data:,"><body style="margin:0">${body}`;
    writeFileSync(join(project, "react.html"), page('<div id="root"></div><script type="module" src="react.tsx"></script>'));
    writeFileSync(join(project, "three.html"), page('<script type="module" src="three.ts"></script>'));
    const element = readFileSync(join(project, "index.html"), "utf8").replace("<!doctype html>", '<!doctype html><link rel="icon" href="data:,">');
    writeFileSync(join(project, "index.html"), element);
    writeFileSync(join(project, "splats.html"), element.replace("walk.reel", "splats.reel"));
    copyFileSync(join(ROOT, "conformance/v1/scene.reel"), join(project, "public/walk.reel"));
    copyFileSync(join(ROOT, "conformance/v1/splats/splats.reel"), join(project, "public/splats.reel"));
    const options = { strict: true, target: "es2022", module: "esnext", moduleResolution: "bundler", jsx: "react-jsx", noEmit: true, types: [], lib: ["ES2022", "DOM"] };
    writeFileSync(join(project, "tsconfig.json"), JSON.stringify({ compilerOptions: options, include: ["main.ts", "three.ts", "react.tsx"] }));
    writeFileSync(join(project, "package.json"), JSON.stringify({ private: true, type: "module" }));
    const others = [...["vite", "typescript", "three", "@types/three"].map(pinned), "react@19", "react-dom@19", "@types/react@19", "@types/react-dom@19"];
    npm(project, "install", "--no-audit", "--no-fund", "--prefer-offline", ...tarballs, ...others);
    browser = await launchBrowser();
  }, 300_000);

  afterAll(async () => {
    await browser?.close();
    rmSync(folder, { recursive: true, force: true });
  });

  /** How much of a page's picture differs from its corner, once something was drawn. */
  async function drawn(page: Page): Promise<number> {
    const share = async (): Promise<number> => {
      const png = (await page.screenshot()).toString("base64");
      return page.evaluate(async (text) => {
        const picture = await createImageBitmap(await (await fetch(`data:image/png;base64,${text}`)).blob());
        const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
        context.drawImage(picture, 0, 0);
        const { data } = context.getImageData(0, 0, picture.width, picture.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (Math.abs(data[i]! - data[0]!) > 12) count++;
        return (4 * count) / data.length;
      }, png);
    };
    await expect.poll(share).toBeGreaterThan(0.01);
    return share();
  }

  async function visit(url: string, name: string): Promise<void> {
    const page = await browser.newPage({ viewport: { width: 640, height: 400 } });
    const errors: string[] = [];
    page.on("pageerror", (error) => errors.push(`${error.name}: ${error.message} ${error.stack}`));
    page.on("console", (message) => {
      if (message.type() === "error") errors.push(`${message.text()} ${message.location().url}`);
    });
    await page.goto(`${url}${name}.html`);
    if (name !== "three") {
      const shown = (): boolean => (document.querySelector("meshreel-player")?.statistics?.triangles ?? 0) > 0;
      await page.waitForFunction(shown).catch((error: Error) => expect.fail(`${name}: ${error.message}\n${errors.join("\n")}`));
    }
    if (name === "react") {
      await page.getByRole("button", { name: "Play", exact: true }).last().click();
      await page.waitForFunction(() => !document.querySelector("figcaption")!.textContent!.endsWith(" 0"));
    }
    if (name === "splats") await page.waitForFunction(() => document.querySelector("meshreel-player")!.statistics!.sortMs > 0);
    await drawn(page);
    if (process.env.MESHREEL_PICTURES) await page.screenshot({ path: join(process.env.MESHREEL_PICTURES, `npm-${name}.png`) });
    expect(errors, name).toEqual([]);
    await page.close();
  }

  test.runIf(ALL)("say where they come from, and hold only what is used", () => {
    for (const name of ["meshreel-player", "meshreel-three"]) {
      const made = JSON.parse(readFileSync(join(project, "node_modules", name, "package.json"), "utf8")) as Record<string, unknown>;
      expect(made).toMatchObject({ license: "Apache-2.0", publishConfig: { provenance: true }, repository: { url: "git+https://github.com/owner/meshreel.git", directory: `web/${name}` } });
      const files = readdirSync(join(project, "node_modules", name), { recursive: true, encoding: "utf8" });
      expect(files).toEqual(expect.arrayContaining(["LICENSE", "NOTICE", "README.md", "index.js"]));
      expect(files.filter((file) => /test|src.*[^d]\.ts$/.test(file))).toEqual([]);
    }
  });

  test.runIf(ALL)("are typed: the examples compile in strict mode, all declarations looked at", () => {
    const tsc = spawnSync(process.execPath, ["node_modules/typescript/bin/tsc", "-p", "."], { cwd: project, encoding: "utf8" });
    expect(tsc.stdout.split("\n").filter((line) => /^(node_modules\/meshreel|\w+\.tsx?)/.test(line))).toEqual([]);
  });

  test.runIf(ALL)("play from what Vite builds", async () => {
    const inputs = PAGES.map((name) => `./${name}.html`);
    const build = `import { build } from "vite"; await build({ base: "./", logLevel: "warn", build: { target: "es2022", rolldownOptions: { input: ${JSON.stringify(inputs)} } } });`;
    execFileSync(process.execPath, ["--input-type=module", "-e", build], { cwd: project });
    const served = await serveFolder(join(project, "dist"));
    try {
      for (const name of PAGES) await visit(served.url, name);
    } finally {
      await served.close();
    }
  });

  test.runIf(ALL)("play from Vite's development server", async () => {
    const server = await createServer({ root: project, logLevel: "error", server: { port: 0, host: "127.0.0.1" } });
    try {
      await server.listen();
      for (const name of PAGES) await visit(server.resolvedUrls!.local[0]!, name);
    } finally {
      await server.close();
    }
  });
});
