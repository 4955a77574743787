// Every control and every key, in a browser, on a playback and a stage that are made up.

import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { describeOnPage } from "./fixture.ts";

describeOnPage("controls of <meshreel-player>", (on) => {
  test("the button and the keys Space and K play and pause", async () => {
    await on.shown();
    await on.page.locator("button.play").click();
    expect(await on.get((player) => player.paused)).toBe(false);
    expect(await on.page.locator("button.play").getAttribute("aria-label")).toBe("Pause");
    for (const [key, paused] of [["Space", true], ["k", false], ["K", true]] as const) {
      await on.press(key);
      expect(await on.get((player) => player.paused)).toBe(paused);
    }
    expect(await on.page.locator("button.play").getAttribute("aria-label")).toBe("Play");
  });

  test("the big button offers the first play only, of each recording", async () => {
    await on.shown();
    const big = () => on.page.locator("button.big").isVisible();
    expect(await big()).toBe(true);
    await on.get((player) => player.play());
    await expect.poll(big).toBe(false);
    await on.get((player) => {
      player.pause();
      player.currentTime = 0;
    });
    await on.eventually((player) => player.paused && !player.seeking && player.currentTime === 0);
    await on.page.waitForTimeout(50);
    expect(await big()).toBe(false);
    await on.get((player) => void (player.src = "other.reel"));
    await expect.poll(big).toBe(true);
  });

  test("Space on a focused button presses that button and nothing else", async () => {
    await on.shown();
    await on.page.locator("button.play").focus();
    await on.page.keyboard.press("Space");
    expect(await on.get((player) => player.paused)).toBe(false);
    await on.page.locator(".row button.loop").focus();
    await on.page.keyboard.press("Space");
    expect(await on.get((player) => [player.loop, player.paused])).toEqual([true, false]);
  });

  test("frames are stepped with buttons and with comma and period", async () => {
    await on.shown();
    const frames = [];
    for (const act of [() => on.page.locator("button.step-forward").click(), () => on.press("."), () => on.press("."), () => on.press(","), () => on.page.locator("button.step-back").click()]) {
      await act();
      await on.eventually((player) => !player.seeking);
      frames.push(await on.get((player) => player.currentFrame));
    }
    expect(frames).toEqual([1, 2, 3, 2, 1]);
  });

  test("arrows, Home and End seek, also from the seek bar", async () => {
    await on.shown();
    for (const focus of [".picture", ".seek .range"]) {
      await on.page.locator(focus).focus();
      const times = [];
      for (const key of ["End", "ArrowLeft", "Home", "ArrowRight", "ArrowRight"]) {
        await on.page.keyboard.press(key);
        await on.eventually((player) => !player.seeking);
        times.push(Number((await on.get((player) => player.currentTime)).toFixed(3)));
      }
      expect(times).toEqual([1.958, 1.758, 0, 0.2, 0.4]);
    }
  });

  test("dragging the seek bar seeks, holds playing meanwhile, and goes on after it", async () => {
    await on.shown();
    await on.get((player) => player.play());
    const box = (await on.page.locator(".seek .range").boundingBox())!;
    await on.page.mouse.move(box.x + box.width / 4, box.y + box.height / 2);
    await on.page.mouse.down();
    expect(await on.get((player) => player.paused)).toBe(true);
    await on.page.mouse.move(box.x + box.width / 2, box.y + box.height / 2, { steps: 8 });
    await on.eventually((player) => !player.seeking && Math.abs(player.currentTime - 1) < 0.02);
    await on.page.mouse.up();
    await on.eventually((player) => !player.paused && !player.seeking);
    expect(await on.get((player) => player.currentTime)).toBeGreaterThan(0.97);
    expect(await on.page.locator(".tip").textContent()).toBe("0:01.00 · 25");
  });

  test("a picture of the time pointed at is shown with the frame's number: kept where it was seen before, else decoded beside playback", async () => {
    await on.shown("muted");
    await on.get((player) => void (player.currentTime = 1));
    await on.eventually((player) => !player.seeking);
    await on.page.waitForTimeout(200);
    const box = (await on.page.locator(".seek .range").boundingBox())!;
    const point = async (share: number): Promise<boolean> => {
      await on.page.mouse.move(box.x + 7 + share * (box.width - 14), box.y + box.height / 2);
      return on.page.locator(".thumbnail").isVisible();
    };
    const draws = await on.page.evaluate(() => engine.stages[0]!.draws);
    expect(await point(0.51)).toBe(true);
    expect(await on.page.evaluate(() => [engine.stages[0]!.draws, engine.playbacks.length])).toEqual([draws, 1]);
    await point(0.755);
    expect(await on.page.locator(".tip").textContent()).toBe("0:01.51 · 37");
    await on.page.locator(".thumbnail").waitFor();
    const made = await on.page.evaluate(() => [engine.stages[0]!.shown!.frame, engine.stages[0]!.draws, engine.playbacks[1]!.layers, engine.playbacks[1]!.currentFrame]);
    expect(made).toEqual([24, draws + 2, 0, 36]); // what is seen was drawn again
    expect(await on.get((player) => player.currentTime)).toBe(1);
    await on.page.mouse.move(box.x + 50, box.y - 100);
    await expect.poll(() => on.page.evaluate(() => engine.playbacks[1]!.disposed)).toBe(true);
    expect(await point(0.51)).toBe(true);
    const colours = await on.page.locator(".thumbnail").evaluate((node: HTMLCanvasElement) => {
      const { data } = node.getContext("2d")!.getImageData(0, 0, node.width, node.height);
      return new Set(Array.from({ length: data.length / 4 }, (_, k) => data.slice(4 * k, 4 * k + 3).join())).size;
    });
    expect(colours).toBeGreaterThan(1);
    if (process.env.MESHREEL_PICTURES) await on.page.screenshot({ path: `${process.env.MESHREEL_PICTURES}/thumbnail.png` });
    await on.get((player) => void (player.src = "other.reel"));
    await on.eventually((player) => player.readyState === 4);
    await point(0.51); // what was kept is of another recording
    await expect.poll(() => on.page.evaluate(() => engine.playbacks.at(-1)!.layers)).toBe(0);
  });

  test("the seek bar says its time and shows what is buffered", async () => {
    await on.shown();
    await on.get((player) => void (player.currentTime = 0.5));
    await on.eventually((player) => !player.seeking);
    const bar = on.page.locator(".seek .range");
    await expect.poll(() => bar.getAttribute("aria-valuetext")).toBe("0.5 seconds of 2 seconds");
    expect(await bar.getAttribute("aria-label")).toBe("Seek");
    const style = await on.page.locator(".seek").evaluate((node) => ["--played", "--buffered"].map((name) => Number(node.style.getPropertyValue(name))));
    expect(style).toEqual([0.25, 0.625]);
    expect(await on.page.locator(".time").textContent()).toBe("0:00.50 / 0:02.00");
    expect(await on.page.locator(".time").getAttribute("title")).toBe("Frame 13 of 48");
  });

  test("speed, quality and shading are chosen in the settings and are then attributes", async () => {
    await on.shown();
    await on.page.getByRole("button", { name: "Settings" }).click();
    await on.page.getByLabel("Playback speed").selectOption("0.5");
    await on.page.getByLabel("Direction").selectOption("Ping-pong");
    await on.page.getByLabel("Quality").selectOption("1");
    await on.page.getByLabel("Shading").selectOption("wireframe");
    expect(await on.get((player) => ["speed", "direction", "layers", "mode"].map((name) => player.getAttribute(name)))).toEqual(["0.5", "alternate", "1", "wireframe"]);
    expect(await on.page.evaluate(() => [engine.playbacks[0]!.playbackRate, engine.playbacks[0]!.layers, engine.stages[0]!.mode])).toEqual([0.5, 1, "wireframe"]);
    await on.page.getByLabel("Quality").selectOption("auto");
    expect(await on.page.evaluate(() => engine.playbacks[0]!.layers)).toBe("auto");
    await on.page.keyboard.press("Escape");
    expect(await on.page.locator(".settings").isHidden()).toBe(true);
    expect(await on.page.getByRole("button", { name: "Settings" }).evaluate((node) => node.matches(":focus"))).toBe(true);
  });

  test("the settings have the names that video players and model viewers have", async () => {
    await on.shown("share");
    const names = await on.page.locator(".settings .label").allTextContents();
    expect(names).toEqual([
      "Playback speed", "Direction", "Quality", "Shading", "Loop", "Statistics", "Save screenshot", "Reset view",
      "Set loop start", "Frame numbers", "Auto-rotate", "Fly mode", "Record loop", "Copy link", "Use this view", "Open file", "Keyboard shortcuts",
    ]);
  });

  test("a part is repeated by one button, without keys: its start, its end, cleared", async () => {
    await on.shown();
    expect(await on.page.locator("div.section").isVisible()).toBe(false);
    await on.page.getByRole("button", { name: "Settings" }).click();
    const sections: unknown[] = [];
    for (const [time, name] of [[0.5, "Set loop start"], [1, "Set loop end"], [0.75, "Clear loop"]] as const) {
      await on.page.evaluate((to) => void (document.querySelector("meshreel-player")!.currentTime = to), time);
      await on.eventually((player) => !player.seeking);
      await on.page.getByRole("button", { name }).click();
      sections.push(await on.get((player) => player.section));
    }
    expect(sections).toEqual([[0.5, 2], [0.5, 1], null]);
  });

  test("letters typed into a menu are the menu's", async () => {
    await on.shown();
    await on.page.getByRole("button", { name: "Settings" }).click();
    await on.page.getByLabel("Shading").focus();
    await on.page.keyboard.press("l");
    expect(await on.get((player) => player.loop)).toBe(false);
  });

  test("loop, statistics and shading have keys and tell their state", async () => {
    await on.shown();
    for (const [key, name] of [["l", "loop"], ["s", "stats"]] as const) {
      await on.press(key);
      const button = on.page.locator(`.row button.${name}`);
      await expect.poll(() => button.getAttribute("aria-pressed")).toBe("true");
      await button.click();
      await expect.poll(() => button.getAttribute("aria-pressed")).toBe("false");
    }
    await on.press("m");
    expect(await on.get((player) => player.mode)).toBe("normal");
    expect(await on.page.locator(".toasts").textContent()).toBe("Normals");
  });

  test("the statistics show the numbers of stream and picture", async () => {
    await on.shown("stats");
    const panel = on.page.locator(".statistics");
    for (const text of ["2.41 Mbit/s", "48.2 Mbit/s", "12.3 ms", "0.8 s", "12.3 MB", "3 of 3", "fps", "Skipped groups"]) {
      await expect.poll(() => panel.textContent()).toContain(text);
    }
    await on.get((player) => void (player.stats = false));
    await expect.poll(() => panel.isHidden()).toBe(true);
  });

  test("fit has a button and the key 0", async () => {
    await on.shown();
    await on.page.locator(".row button.fit").click();
    await on.press("0");
    expect(await on.page.evaluate(() => engine.stages[0]!.fits)).toBe(2);
  });

  test("the camera turns with Shift and arrows, and comes closer with plus and minus", async () => {
    await on.shown();
    for (const key of ["Shift+ArrowLeft", "Shift+ArrowRight", "Shift+ArrowUp", "Shift+ArrowDown", "+", "-"]) await on.press(key);
    const signs = await on.page.evaluate(() => engine.stages[0]!.orbits.map(([right, up, closer = 1]) => [right!, up!, Math.log(closer)].map(Math.sign)));
    expect(signs).toEqual([[-1, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]);
    expect(await on.get((player) => player.currentTime)).toBe(0);
  });

  test("the screenshot button saves a PNG named after recording and frame", async () => {
    await on.shown();
    const [download] = await Promise.all([on.page.waitForEvent("download"), on.page.locator(".row button.screenshot").click()]);
    expect(download.suggestedFilename()).toBe("walk-1.png");
    expect(await on.get(async (player) => (await player.screenshot()).type)).toBe("image/png");
  });

  test("a screenshot shows the frame of its moment, though no picture was drawn since", async () => {
    await on.shown();
    const frame = await on.get((player) => {
      player.currentTime = 1;
      void player.screenshot();
      return engine.stages[0]!.shown!.frame;
    });
    expect(frame).toBe(24);
  });

  test("a loop, or its section, is recorded from its start as a video that plays, and pausing ends it early", async () => {
    for (const [attributes, pause, length] of [['section="0.5,1.2"', false, 0.7], ["loop", false, 2], ["loop", true, 1], ['direction="reverse"', false, 2], ['direction="alternate"', false, 4]] as const) {
      await on.shown(attributes);
      await on.get((player) => void (player.currentTime = 1));
      await on.page.getByRole("button", { name: "Settings" }).click();
      const download = on.page.waitForEvent("download");
      await on.page.locator(".settings button.record").click();
      await on.eventually((player) => !player.paused);
      expect(await on.page.locator(".settings button.record").getAttribute("aria-label")).toBe("Stop recording");
      if (pause) {
        await on.page.waitForTimeout(800);
        await on.page.locator(".settings button.record").click();
      }
      const file = await download;
      expect(file.suggestedFilename()).toMatch(/^walk\.(mp4|webm)$/);
      await on.eventually((player) => player.paused);
      const data = readFileSync(await file.path()).toString("base64");
      const video = await on.page.evaluate(async ([text, type]) => {
        const shown = document.createElement("video");
        shown.src = `data:${type};base64,${text}`;
        await new Promise((done, fail) => Object.assign(shown, { onloadedmetadata: done, onerror: fail }));
        shown.currentTime = 1e6; // what a browser records does not say how long it is
        await new Promise((done) => void (shown.onseeked = done));
        return [shown.currentTime, shown.videoWidth];
      }, [data, file.suggestedFilename().endsWith("mp4") ? "video/mp4" : "video/webm"] as const);
      expect(video[0]).toBeGreaterThan(pause ? 0.1 : length / 2);
      expect(video[0]).toBeLessThan(length + 1.5); // a busy machine begins and ends late
      expect(video[1]).toBeGreaterThan(100);
    }
  });

  test("full screen is entered and left with button and key", async () => {
    await on.shown();
    await on.page.locator("button.fullscreen").click();
    await on.page.waitForFunction(() => document.fullscreenElement?.localName === "meshreel-player");
    await expect.poll(() => on.page.locator("button.fullscreen").getAttribute("aria-label")).toBe("Exit full screen");
    await on.press("f");
    await on.page.waitForFunction(() => document.fullscreenElement === null);
  });

  test("help opens with a question mark, takes the focus, and closes with Escape", async () => {
    await on.shown();
    await on.press("?");
    const help = on.page.getByRole("dialog", { name: "Keyboard shortcuts" });
    expect(await help.isVisible()).toBe(true);
    expect(await help.textContent()).toContain("next frame");
    await on.page.keyboard.press("Escape");
    expect(await help.isVisible()).toBe(false);
    await on.page.getByRole("button", { name: "Settings" }).click();
    await on.page.locator("button.help").click();
    expect(await on.page.locator(".settings").isVisible()).toBe(false);
    await help.getByRole("button", { name: "Close" }).click();
    expect(await help.isVisible()).toBe(false);
  });

  test("keys act only where the player has the focus, and not in form fields", async () => {
    await on.put('<input id="field"><meshreel-player src="walk.reel" controls><textarea id="inner"></textarea></meshreel-player>');
    await on.page.locator("#field").press("k");
    await on.page.evaluate(() => {
      document.body.focus();
      (document.activeElement as HTMLElement).blur();
    });
    await on.page.keyboard.press("k");
    await on.page.keyboard.press("Space");
    await on.page.evaluate(() => {
      const field = document.querySelector("#inner")!;
      field.dispatchEvent(new KeyboardEvent("keydown", { key: "k", bubbles: true, composed: true }));
    });
    expect(await on.get((player) => player.paused)).toBe(true);
    await on.press("Control+k");
    expect(await on.get((player) => player.paused)).toBe(true);
  });

  test("a click on the picture plays and pauses, a drag does not", async () => {
    await on.shown();
    await on.page.mouse.click(400, 100);
    expect(await on.get((player) => player.paused)).toBe(false);
    await on.page.mouse.move(300, 100);
    await on.page.mouse.down();
    await on.page.mouse.move(360, 120, { steps: 4 });
    await on.page.mouse.up();
    expect(await on.get((player) => player.paused)).toBe(false);
  });

  test("a dropped file is shown to be welcome, opened and played", async () => {
    await on.shown();
    await on.page.evaluate(() => {
      const data = new DataTransfer();
      data.items.add(new File(["x"], "notes.txt"));
      data.items.add(new File(["MRL"], "local.reel"));
      const drag = (type: string) => new DragEvent(type, { dataTransfer: data, bubbles: true, composed: true, cancelable: true });
      const root = document.querySelector("meshreel-player")!.shadowRoot!.querySelector(".root")!;
      root.dispatchEvent(drag("dragenter"));
      Object.assign(globalThis, { over: root.hasAttribute("data-over"), taken: !root.dispatchEvent(drag("drop")), after: root.hasAttribute("data-over") });
    });
    expect(await on.page.evaluate("[over, taken, after]")).toEqual([true, true, false]);
    expect(await on.page.evaluate(() => (engine.playbacks.at(-1)!.source as File).name)).toBe("local.reel");
    expect(await on.page.evaluate(() => engine.playbacks.map(({ disposed }) => disposed))).toEqual([true, false]);
    await on.eventually((player) => !player.paused && player.currentTime > 0);
  });

  test("a file can be opened with the button", async () => {
    await on.put("<meshreel-player controls></meshreel-player>", false);
    expect(await on.page.locator(".empty").isVisible()).toBe(true);
    const [chooser] = await Promise.all([on.page.waitForEvent("filechooser"), on.page.locator(".empty button").click()]);
    await chooser.setFiles({ name: "mine.reel", mimeType: "", buffer: Buffer.from("MRL") });
    await on.eventually((player) => player.readyState === 4);
    expect(await on.page.locator(".empty").isVisible()).toBe(false);
  });

  test("an error is told in plain words, and Try again tries again", async () => {
    await on.put('<meshreel-player src="404.reel" controls></meshreel-player>', false);
    const panel = on.page.getByRole("alert");
    await panel.waitFor();
    expect(await panel.textContent()).toContain("The recording was not found");
    expect(await on.get((player) => player.error!.message)).toContain("404");
    await panel.getByRole("button", { name: "Try again" }).click();
    expect(await on.page.evaluate(() => engine.playbacks.length)).toBe(2);
    await panel.waitFor();
    await on.get((player) => void (player.src = "walk.reel"));
    await on.eventually((player) => player.readyState === 4);
    expect(await panel.isVisible()).toBe(false);
    expect(await on.get((player) => player.error)).toBeNull();
  });

  test("a retry goes on where the network failed", async () => {
    await on.shown();
    await on.get((player) => void (player.currentTime = 1.25));
    await on.page.evaluate(() => engine.playbacks[0]!.fail("http://x: no answer"));
    await on.page.getByRole("button", { name: "Try again" }).click();
    await on.eventually((player) => player.readyState === 4);
    expect(await on.get((player) => player.currentTime)).toBe(1.25);
  });

  test("the last warning is shown for a while, with the number of others", async () => {
    await on.shown();
    await on.page.evaluate(() => ["group 3 is damaged", "group 3 is damaged", "slow"].forEach((text) => engine.playbacks[0]!.warn(text)));
    expect(await on.page.locator(".toast").allTextContents()).toEqual(["slowand 1 more"]);
    expect(await on.page.locator(".toasts").getAttribute("aria-live")).toBe("polite");
  });

  test("without WebGL 2 the player says so", async () => {
    await on.page.evaluate(() => void (engine.webgl = false));
    await on.put('<meshreel-player src="walk.reel" controls></meshreel-player>', false);
    await on.page.evaluate(() => void (engine.webgl = true));
    expect(await on.page.getByRole("alert").textContent()).toContain("WebGL 2 is not available");
    await on.page.getByRole("button", { name: "Try again" }).click();
    await on.eventually((player) => player.readyState === 4);
  });

  test("a spinner turns while it waits", async () => {
    await on.shown();
    expect(await on.page.locator(".spinner").isVisible()).toBe(false);
    await on.page.evaluate(() => engine.playbacks[0]!.dispatchEvent(new Event("waiting")));
    await on.page.locator(".spinner").waitFor();
    await on.page.evaluate(() => engine.playbacks[0]!.dispatchEvent(new Event("playing")));
    await on.page.locator(".spinner").waitFor({ state: "hidden" });
  });

  test("no VR button where there is no headset, and V says why", async () => {
    await on.shown();
    expect(await on.page.locator("button.vr").isVisible()).toBe(false);
    await on.press("v");
    await expect.poll(() => on.page.locator(".toasts").textContent()).toBe("No headset found");
  });

  test("on a phone without WebXR its own app shows the file that the page names for it", async () => {
    await on.page.evaluate(() => {
      HTMLAnchorElement.prototype.click = function () {
        Object.assign(globalThis, { opened: this });
      };
      Object.assign(globalThis, { supports: DOMTokenList.prototype.supports });
    });
    /** What a click opens on a phone; "" where there is no button. */
    const opened = async (phone: "iPhone" | "Android" | "", attributes: string): Promise<string> => {
      await on.page.evaluate((name) => {
        Object.defineProperty(navigator, "userAgent", { configurable: true, value: `Mozilla/5.0 (${name})` });
        DOMTokenList.prototype.supports = () => name === "iPhone";
      }, phone);
      await on.shown(attributes);
      if (!(await on.page.locator("button.ar").isVisible())) return "";
      await on.page.locator("button.ar").click();
      return on.page.evaluate("`${opened.rel} ${opened.querySelectorAll('img').length} ${opened.href}`");
    };
    const both = 'usdz="/walk.usdz" glb="/walk.glb"';
    const site = new URL("/", on.page.url()).href;
    expect(await opened("", both)).toBe("");
    expect(await opened("iPhone", 'glb="/walk.glb"')).toBe("");
    expect(await opened("Android", 'usdz="/walk.usdz"')).toBe("");
    for (const wrong of ["javascript:alert(1)", "http://"]) {
      expect(await opened("iPhone", `usdz="${wrong}"`)).toBe("");
      expect(await opened("Android", `glb="${wrong}"`)).toBe("");
    }
    expect(await opened("iPhone", both)).toBe(`ar 1 ${site}walk.usdz#allowsContentScaling=0`);
    const [address, intent] = (await opened("Android", both)).split("#");
    expect(address).toBe(` 0 intent://arvr.google.com/scene-viewer/1.0?file=${encodeURIComponent(site)}walk.glb&mode=ar_preferred&resizable=false`);
    expect(intent).toBe(`Intent;scheme=https;package=com.google.android.googlequicksearchbox;action=android.intent.action.VIEW;S.browser_fallback_url=${encodeURIComponent(on.page.url())};end;`);
    await on.page.evaluate(() => {
      for (const [from, name] of [[HTMLAnchorElement.prototype, "click"], [navigator, "userAgent"]] as const) Reflect.deleteProperty(from, name);
      DOMTokenList.prototype.supports = (globalThis as unknown as DOMTokenList).supports;
    });
  });

  test("time stands still while no picture can be drawn, as in a page that was hidden", async () => {
    await on.shown("loop");
    const times = await on.page.evaluate(async () => {
      const player = document.querySelector("meshreel-player")!;
      await player.enterVr();
      await player.play();
      const { frame } = engine.stages[0]!;
      return [0, 20, 40, 600_040, 600_060, 300, 320].map((now) => {
        frame!(now);
        return Math.round(player.currentTime * 1000);
      });
    });
    expect(times).toEqual([0, 20, 40, 57, 77, 93, 113]);
    await on.get((player) => player.exitVr());
  });

  test("with a headset its frames drive the picture", async () => {
    await on.page.evaluate(() => Object.defineProperty(navigator, "xr", { configurable: true, value: { isSessionSupported: async () => true } }));
    await on.shown();
    await on.page.locator("button.vr").click();
    await on.eventually((player) => player.presenting);
    const drawn = await on.page.evaluate(() => {
      const stage = engine.stages[0]!;
      const before = stage.draws;
      for (let i = 0; i < 3; i++) stage.frame!(performance.now() + i * 13);
      return stage.draws - before;
    });
    expect(drawn).toBe(3);
    await on.page.locator("button.vr").click();
    await on.eventually((player) => !player.presenting);
    await on.page.evaluate(() => Reflect.deleteProperty(navigator, "xr"));
  });
});
