// The built player with real recordings, as it is embedded: in pages, frames, under strict policies, from another origin.

import { readdirSync, readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import type { Frame, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { describeInBrowser } from "../../test/browser.ts";
import { slowTest } from "../../test/slow.ts";
import { FileServer } from "../../player-core/test/server.ts";
import { ROOT } from "../../test/python.ts";
import { buildPlayer, Site } from "./product.ts";

const PLAYER = '<meshreel-player src="scene.reel" controls style="width:320px;height:240px;aspect-ratio:auto"></meshreel-player>';
const SCRIPT = '<script type="module" src="player/meshreel-player.js"></script>';
const STRICT = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' data:; connect-src 'self'";

const ready = (page: Page | Frame) =>
  page.waitForFunction(() => document.querySelector("meshreel-player")!.readyState >= 2 && document.querySelector("meshreel-player")!.statistics!.triangles > 0);
const ended = (page: Page | Frame) => page.waitForFunction(() => document.querySelector("meshreel-player")!.ended);

describeInBrowser("the built player", () => {
  const site = new Site();
  beforeAll(() => site.open(), 120_000);
  afterAll(() => site.close());

  /** How many of the picture's pixels are not its background. */
  async function covered(page: Page | Frame): Promise<number> {
    return page.evaluate(async () => {
      const picture = await createImageBitmap(await document.querySelector("meshreel-player")!.screenshot());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i] !== data[0] || data[i + 1] !== data[1] || data[i + 2] !== data[2]) count++;
      return count / (data.length / 4);
    });
  }

  /** The rows and columns of the picture between which it is not white. */
  async function extent(page: Page): Promise<{ top: number; bottom: number; left: number; right: number }> {
    return page.evaluate(async () => {
      const picture = await createImageBitmap(await document.querySelector("meshreel-player")!.screenshot());
      const { width, height } = picture;
      const context = new OffscreenCanvas(width, height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, width, height);
      const found = { top: height, bottom: -1, left: width, right: -1 };
      for (let i = 0; i < width * height; i++) {
        if (Math.min(data[4 * i]!, data[4 * i + 1]!, data[4 * i + 2]!) > 250) continue;
        const [x, y] = [i % width, Math.floor(i / width)];
        Object.assign(found, {
          top: Math.min(found.top, y), bottom: Math.max(found.bottom, y), left: Math.min(found.left, x), right: Math.max(found.right, x),
        });
      }
      return found;
    });
  }

  test("its page plays the recording that the address names", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/scene.reel&autoplay&stats");
    await ready(page);
    expect(await page.title()).toBe("scene · meshreel");
    expect(await covered(page)).toBeGreaterThan(0.02);
    await ended(page);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("its page takes keys before anybody has clicked, but not from a page around it", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/scene.reel&loop");
    await ready(page);
    await page.keyboard.press("k");
    await page.waitForFunction(() => !document.querySelector("meshreel-player")!.paused);
    await page.close();
    site.write("framed.html", '<!doctype html><link rel="icon" href="data:,"><iframe src="player/index.html?src=/scene.reel"></iframe>');
    const outer = await site.visit("framed.html");
    await ready(outer.page.frames()[1]!);
    expect(await outer.page.evaluate(() => document.activeElement === document.body)).toBe(true);
    expect(await outer.page.frames()[1]!.evaluate(() => document.activeElement === document.body)).toBe(true);
    expect([...errors, ...outer.errors]).toEqual([]);
    await outer.page.close();
  });

  for (const name of ["layers", "mixed", "laplacian", "draco"]) {
    test(`plays ${name}.reel to its end`, async () => {
      const { page, errors } = await site.visit(`player/index.html?src=/${name}.reel&autoplay`);
      await ready(page);
      await ended(page);
      expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.skippedGroups)).toBe(0);
      expect(errors).toEqual([]);
      await page.close();
    });
  }

  test("?bench tells what was decoded and drawn, as text and as JSON", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/layers.reel&bench=2");
    const text = await page.waitForFunction(() => {
      const said = document.querySelector("pre")?.textContent ?? "";
      return said.includes("{") ? said : null;
    });
    const said = (await text.jsonValue())!;
    expect(said).toContain("JavaScript a picture");
    const report = JSON.parse(said.slice(said.indexOf("{")));
    expect(report.pictures).toBeGreaterThan(0);
    expect(report.scriptMs.median).toBeGreaterThan(0);
    expect(report.triangles).toBeGreaterThan(0);
    expect(report.groups).toBeGreaterThan(0); // though all of so short a file is decoded before it plays
    expect(report.decodeMs.median).toBeGreaterThan(0);
    expect(report.seeks).toBe(12);
    expect(report.seekMs.median).toBeGreaterThan(0);
    expect(report.seekMs.most95).toBeGreaterThanOrEqual(report.seekMs.median);
    expect(said).toMatch(/^seek: [\d.]+ \/ [\d.]+ ms, 12 seeks$/m);
    expect(report).toMatchObject({ place: "page, 320 x 240", gpu: expect.stringContaining("SwiftShader") });
    expect(errors).toEqual([]);
    await page.close();
  });

  test("the address sets time, shading and camera", async () => {
    const { page } = await site.visit("player/index.html?src=/scene.reel&t=0.1&mode=normal&layers=0&loop");
    await ready(page);
    const state = await page.evaluate(() => {
      const { currentTime, mode, layers, loop, paused } = document.querySelector("meshreel-player")!;
      return { currentTime, mode, layers, loop, paused };
    });
    expect(state).toEqual({ currentTime: 0.1, mode: "normal", layers: 0, loop: true, paused: true });
    await page.close();
  });

  test("what the address says holds when the recording of a page opens, not after", async () => {
    site.write("watch.html", '<!doctype html><link rel="icon" href="data:,"><script type="module" src="player/page.js"></script><meshreel-player src="scene.reel" autoplay></meshreel-player>');
    const { page, errors } = await site.visit("watch.html?autoplay=0", [{ content: 'addEventListener("play", () => (globalThis.played = true), true)' }]);
    await ready(page);
    expect(await page.evaluate(() => "played" in globalThis)).toBe(false);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a view that fits lies above the bar, in any shape, until somebody moves the camera", async () => {
    const { page } = await site.visit("player/index.html?src=/layers.reel&background=white");
    await ready(page);
    const bar = (await page.locator(".bar").boundingBox())!;
    for (const [width, height] of [[320, 240], [240, 400], [640, 200]] as const) {
      await page.setViewportSize({ width, height });
      await page.waitForFunction(([w, h]) => document.querySelector("meshreel-player")!.shadowRoot!.querySelector("canvas")!.width === w && innerHeight === h, [width, height] as const);
      const { top, bottom, left, right } = await extent(page);
      expect([top > 0, bottom < height - bar.height, left > 0, right < width - 1], `${width} x ${height}: ${[top, bottom, left, right]}`).toEqual([true, true, true, true]);
    }
    await page.locator(".picture").press("Shift+ArrowUp");
    const moved = await page.evaluate(() => document.querySelector("meshreel-player")!.camera);
    await page.setViewportSize({ width: 320, height: 240 });
    await page.waitForTimeout(300);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.camera)).toBe(moved);
    await page.close();
  });

  test("the layers that are chosen are shown, also while it is paused", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/layers.reel&layers=0");
    await ready(page);
    const shown = (layers: number) =>
      page.waitForFunction((wanted) => document.querySelector("meshreel-player")!.statistics!.layers === wanted, layers);
    await shown(0);
    const most = await page.evaluate(() => document.querySelector("meshreel-player")!.info!.mostLayers);
    expect(most).toBeGreaterThan(0);
    await page.locator("button.more").click();
    await page.getByLabel("Quality").selectOption({ label: "Highest" });
    await shown(most);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("all layers are shown of a picture that stands, and of a loop, however the line was measured", async () => {
    const server = await FileServer.of(readFileSync(join(ROOT, "conformance/v1/layers.reel")));
    server.respond = async (response, asked, count) => {
      response.setHeader("Access-Control-Allow-Origin", "*");
      response.setHeader("Access-Control-Expose-Headers", "Content-Range");
      await new Promise((done) => setTimeout(done, count === 0 ? 300 : 0));
      const body = server.begin(response, asked);
      for (let at = 0; at < body.length; at += 100) {
        response.write(body.subarray(at, at + 100));
        await new Promise((done) => setTimeout(done, 50)); // 16 kbit/s
      }
      response.end();
    };
    for (const looped of ["autoplay=0", "autoplay&loop"]) {
      const { page, errors } = await site.visit(`player/index.html?src=${server.url}&${looped}`);
      await page.waitForFunction(() => {
        const { triangles, layers, wholeLayers } = document.querySelector("meshreel-player")?.statistics ?? {};
        return triangles! > 0 && wholeLayers! > 0 && layers === wholeLayers;
      });
      expect(errors).toEqual([]);
      await page.close();
    }
    await server.close();
  });

  test("a file that is not there is told", async () => {
    const { page } = await site.visit("player/index.html?src=/none.reel");
    await page.getByRole("alert").waitFor();
    expect(await page.getByRole("alert").textContent()).toContain("The recording was not found");
    await page.close();
  });

  test("a file that is no .reel is told", async () => {
    site.write("text.reel", "this is a text, and it is long enough to have had a head if it had been one".repeat(9));
    const { page } = await site.visit("player/index.html?src=/text.reel");
    await page.getByRole("alert").waitFor();
    expect(await page.getByRole("alert").textContent()).toContain("This is not a .reel file");
    await page.close();
  });

  test("a damaged group is told and skipped, and the rest is played to its end", async () => {
    const bytes = readFileSync(join(site.folder, "layers.reel"));
    bytes[bytes.length - 9]! ^= 1; // in the last group
    site.write("damaged.reel", bytes);
    const { page, errors } = await site.visit("player/index.html?src=/damaged.reel&autoplay&speed=0.5");
    await page.locator(".toast").getByText(/^chunk \d+ \(track 0, .* is skipped$/).waitFor();
    await ended(page);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.skippedGroups)).toBe(1);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a local file is opened and played", async () => {
    const { page } = await site.visit("player/index.html");
    await page.locator("input[type=file]").setInputFiles(join(site.folder, "layers.reel"));
    await ready(page);
    await ended(page);
    await page.close();
  });

  test("a strict content security policy lets it play", async () => {
    site.write("strict.html", `<!doctype html><link rel="icon" href="data:,">${SCRIPT}<meshreel-player src="scene.reel" controls autoplay></meshreel-player>`);
    const url = await site.serveAgain({ "Content-Security-Policy": STRICT });
    const { page, errors } = await site.visit(`${url}strict.html`);
    await ready(page);
    await ended(page);
    expect(errors).toEqual([]);
    await page.close();
  });

  test.each([
    { where: "a host that compresses nothing", headers: {}, script: null, aborted: null, packed: ["core.wasm.gz", "meshreel-player.js.gz", "three.js.gz"], refusals: 0 },
    { where: "a browser that unpacks nothing", headers: {}, script: "delete globalThis.DecompressionStream", aborted: null, packed: [], refusals: 0 },
    { where: "a host that has no gzips", headers: {}, script: null, aborted: "**/*.gz", packed: ["core.wasm.gz", "meshreel-player.js.gz", "three.js.gz"], refusals: 3 },
    { where: "a page whose policy refuses what is unpacked", headers: { "Content-Security-Policy": STRICT }, script: null, aborted: null, packed: ["core.wasm.gz", "meshreel-player.js.gz", "three.js.gz"], refusals: 2 },
  ])("load.js plays on $where", async ({ headers, script, aborted, packed, refusals }) => {
    site.write("loaded.html", '<!doctype html><link rel="icon" href="data:,"><script type="module" src="player/load.js"></script><meshreel-player src="scene.reel"></meshreel-player>');
    const url = await site.serveAgain(headers);
    site.write("empty.html", '<!doctype html><link rel="icon" href="data:,">');
    const { page, errors } = await site.visit("empty.html", script === null ? [] : [{ content: script }]);
    if (aborted !== null) await page.route(aborted, (route) => route.abort());
    const asked: string[] = [];
    page.on("request", (request) => asked.push(request.url().replace(/.*\//, "")));
    await page.goto(`${url}loaded.html`);
    await ready(page);
    expect([...new Set(asked)].filter((name) => name.endsWith(".gz")).sort()).toEqual(packed);
    expect(asked.includes("three.js")).toBe(packed.length === 0 || refusals > 0);
    expect(new Set(errors).size > 0).toBe(refusals > 0);
    await page.close();
  });

  test("it plays in a frame without rights, and offers no full screen there", async () => {
    site.write("inner.html", `<!doctype html>${SCRIPT}${PLAYER}`);
    const frameOf = `<iframe src="inner.html" sandbox="allow-scripts allow-same-origin" allow="fullscreen 'none'" width="340" height="260"></iframe>`;
    site.write("frame.html", `<!doctype html><link rel="icon" href="data:,">${frameOf}`);
    const { page, errors } = await site.visit("frame.html");
    const frame = page.frame({ url: /inner/ })!;
    await frame.waitForFunction(() => customElements.get("meshreel-player"));
    await ready(frame);
    await frame.locator("button.play").click();
    await ended(frame);
    expect(await frame.locator("button.fullscreen").isVisible()).toBe(false);
    expect(await covered(frame)).toBeGreaterThan(0.02);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("player and recording may come from another origin", async () => {
    const url = await site.serveAgain({ "Access-Control-Allow-Origin": "*", "Access-Control-Expose-Headers": "Content-Range, ETag" });
    site.write("far.html", `<!doctype html><link rel="icon" href="data:,"><script type="module" src="${url}player/meshreel-player.js"></script>
      <meshreel-player src="${url}scene.reel" controls autoplay></meshreel-player>`);
    const { page, errors } = await site.visit("far.html");
    await ready(page);
    await ended(page);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("a GPU context that is lost comes back with the picture", async () => {
    const { page } = await site.visit("player/index.html?src=/scene.reel");
    await ready(page);
    const before = await covered(page);
    await page.evaluate(async () => {
      const player = document.querySelector("meshreel-player")!;
      const gl = player.shadowRoot!.querySelector("canvas")!.getContext("webgl2")!;
      const loss = gl.getExtension("WEBGL_lose_context")!;
      const told = (type: string) => new Promise((done) => player.addEventListener(type, done, { once: true }));
      const [lost, restored] = [told("lost"), told("restored")];
      loss.loseContext();
      await lost;
      await new Promise((done) => setTimeout(done, 100)); // it cannot be asked back within the event
      loss.restoreContext();
      await restored;
    });
    expect(await page.locator(".toast").textContent()).toContain("graphics driver");
    await expect.poll(() => covered(page)).toBeCloseTo(before, 2);
    await page.close();
  });

  test("two players share the workers, and none is left when both are gone", async () => {
    site.write("two.html", `<!doctype html><link rel="icon" href="data:,">${SCRIPT}${PLAYER}${PLAYER}`);
    const { page, errors } = await site.visit("two.html");
    await page.waitForFunction(() => [...document.querySelectorAll("meshreel-player")].every((player) => player.readyState >= 2));
    const many = page.workers().length;
    expect(many).toBeGreaterThan(0);
    await page.evaluate(() => document.querySelector("meshreel-player")!.remove());
    await page.waitForTimeout(1500);
    expect(page.workers().length).toBe(many);
    await page.evaluate(() => document.querySelector("meshreel-player")!.remove());
    await expect.poll(() => page.workers().length).toBe(0);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("nothing of a player that was taken out stays in memory", async () => {
    site.write("many.html", `<!doctype html><link rel="icon" href="data:,">${SCRIPT}`);
    const { page, errors } = await site.visit("many.html");
    await page.evaluate(() => customElements.whenDefined("meshreel-player").then(() => undefined));
    const refs = await page.evaluateHandle(async () => {
      const refs: WeakRef<object>[] = [];
      for (let i = 0; i < 20; i++) { // more than a browser has WebGL contexts
        const player = document.createElement("meshreel-player");
        Object.assign(player, { src: "scene.reel", controls: true });
        document.body.append(player);
        await new Promise((done) => player.addEventListener("canplay", done, { once: true }));
        refs.push(new WeakRef(player), new WeakRef(player.shadowRoot!.querySelector("canvas")!));
        player.remove();
      }
      return refs;
    });
    const devtools = await page.context().newCDPSession(page);
    await expect.poll(async () => {
      await devtools.send("HeapProfiler.collectGarbage");
      return refs.evaluate((all) => all.filter((ref) => ref.deref()).length);
    }).toBe(0);
    expect(errors).toEqual([]);
    await page.close();
  });

  slowTest("twenty loops leave heap and GPU memory as they were", async () => {
    const { page, errors } = await site.visit("player/index.html?src=/scene.reel&autoplay&loop&speed=4");
    await ready(page);
    const devtools = await page.context().newCDPSession(page);
    const loops = (count: number) => page.evaluate((wanted) => new Promise<void>((done) => {
      const player = document.querySelector("meshreel-player")!;
      let [before, seen] = [player.currentTime, 0];
      const look = () => {
        if (player.currentTime < before) seen++;
        before = player.currentTime;
        if (seen < wanted) requestAnimationFrame(look);
        else done();
      };
      look();
    }), count);
    const memory = async () => {
      await devtools.send("HeapProfiler.collectGarbage");
      const { usedSize } = await devtools.send("Runtime.getHeapUsage");
      return { heap: usedSize, gpu: await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.gpuBytes) };
    };
    await loops(40); // until the browser has compiled what runs often, which takes memory once
    const growths: { heap: number; gpu: number }[] = [];
    while (growths.length < 3 && !growths.some(({ heap, gpu }) => heap < 1.05 && gpu < 1.05)) { // what leaks grows each time
      const before = await memory();
      await loops(20);
      const after = await memory();
      growths.push({ heap: after.heap / before.heap, gpu: after.gpu / before.gpu });
    }
    expect(growths.at(-1)!.heap).toBeLessThan(1.05);
    expect(growths.at(-1)!.gpu).toBeLessThan(1.05);
    expect(errors).toEqual([]);
    await page.close();
  });

  test("another build gives the same bytes, without maps and without addresses of others", async () => {
    await buildPlayer(join(site.folder, "again"));
    const files = readdirSync(join(site.folder, "player")).sort();
    expect(readdirSync(join(site.folder, "again")).sort()).toEqual(files);
    expect(files).toEqual([
      "LICENSES.txt", "core.wasm", "core.wasm.br", "core.wasm.gz", "index.html", "load.js", "load.js.br", "meshreel-player.js", "meshreel-player.js.br",
      "meshreel-player.js.gz", "order.js", "order.js.br", "page.css", "page.js", "page.js.br", "study.js", "study.js.br", "three.js", "three.js.br", "three.js.gz",
      "worker.js", "worker.js.br",
    ]);
    for (const name of files) {
      const bytes = readFileSync(join(site.folder, "player", name));
      expect(bytes.equals(readFileSync(join(site.folder, "again", name))), name).toBe(true);
      if (name.endsWith(".js")) expect(bytes.toString(), name).not.toMatch(/sourceMappingURL|\beval\(|new Function\(|fetch\(["'`]https?:/);
    }
    const licences = readFileSync(join(site.folder, "player/LICENSES.txt"), "utf8");
    for (const text of ["three.js", "The MIT License", "Apache License", "Eigen"]) expect(licences).toContain(text);
  });

  test("the player is small enough for a page", () => {
    const size = (name: string) => gzipSync(readFileSync(join(site.folder, "player", name))).length;
    expect(size("meshreel-player.js")).toBeLessThan(52_000);
    expect(size("three.js")).toBeLessThan(140_000);
    expect(size("worker.js") + size("core.wasm")).toBeLessThan(150_000);
    expect(size("study.js")).toBeLessThan(9_000); // of studies alone
    const sent = ["load.js", "page.js", "meshreel-player.js", "three.js", "worker.js", "core.wasm"].map((name) => statSync(join(site.folder, "player", `${name}.br`)).size);
    expect(sent.reduce((sum, bytes) => sum + bytes)).toBeLessThan(280_000);
  });
});
