// The element as HTML and scripts see it: its life, its events, its properties.

import { expect, test } from "vitest";
import { describeOnPage } from "./fixture.ts";

describeOnPage("<meshreel-player>", (on) => {
  test("nothing is asked of the GPU while it is paused, and a change draws once", async () => {
    await on.shown();
    await on.eventually((player) => player.statistics!.drawn > 0);
    const count = () => on.page.evaluate(() => [engine.stages[0]!.draws, engine.playbacks[0]!.updates]);
    const isStill = async () => {
      const before = await count();
      await on.page.waitForTimeout(300);
      return (await count()).join() === before.join();
    };
    await expect.poll(isStill).toBe(true);
    const before = await count();
    await on.get((player) => player.fit());
    await expect.poll(async () => (await count())[0]! - before[0]!).toBe(1);
    await on.page.waitForTimeout(100);
    expect((await count())[0]! - before[0]!).toBe(1);
  });

  test("a src that changes ends what was open before", async () => {
    await on.shown();
    await on.get((player) => void (player.src = "other.reel"));
    await on.eventually((player) => player.readyState === 4 && player.currentSrc.endsWith("other.reel"));
    expect(await on.page.evaluate(() => engine.playbacks.map(({ disposed }) => disposed))).toEqual([true, false]);
    expect(await on.page.evaluate(() => engine.stages.length)).toBe(1);
    await on.get((player) => player.removeAttribute("src"));
    await on.eventually((player) => player.readyState === 0);
    expect(await on.page.evaluate(() => engine.playbacks.every(({ disposed }) => disposed))).toBe(true);
  });

  test("playing right after it was made plays what is opened, once", async () => {
    await on.put("", false);
    const played = await on.page.evaluate(async () => {
      const player = document.createElement("meshreel-player");
      player.src = "walk.reel";
      document.body.append(player);
      await player.play();
      return [player.paused, engine.playbacks.length];
    });
    expect(played).toEqual([false, 1]);
  });

  test("removal disposes everything, a move nothing, and it works when put in again", async () => {
    await on.put('<section></section><meshreel-player src="walk.reel" controls stats></meshreel-player>');
    const disposed = () => on.page.evaluate(() => [...engine.playbacks, ...engine.stages].map((one) => one.disposed));
    await on.get((player) => document.querySelector("section")!.append(player));
    await on.page.evaluate(() => new Promise((done) => setTimeout(done)));
    expect(await disposed()).toEqual([false, false]);
    await on.get((player) => void (player.currentTime = 1));
    await on.eventually((player) => !player.seeking);
    await on.get((player) => {
      Object.assign(globalThis, { kept: player });
      player.remove();
    });
    await on.page.evaluate(() => new Promise((done) => setTimeout(done)));
    expect(await disposed()).toEqual([true, true]);
    expect(await on.page.evaluate("kept.shadowRoot.querySelectorAll('canvas:not(.thumbnail)').length")).toBe(0);
    await on.page.evaluate("document.body.append(kept)");
    await on.eventually((player) => player.readyState === 4);
    expect(await on.get((player) => [player.currentTime, player.paused])).toEqual([1, true]);
    await on.press("k");
    await on.eventually((player) => player.currentTime > 1);
  });

  test("a player that was taken out leaves nothing behind", async () => {
    const players = await on.page.evaluate(async () => {
      document.body.replaceChildren();
      const refs: WeakRef<Element>[] = [];
      for (let i = 0; i < 5; i++) {
        const player = document.createElement("meshreel-player");
        Object.assign(player, { src: `gone${i}.reel`, controls: true, stats: true });
        document.body.append(player);
        await new Promise((done) => setTimeout(done, 60));
        player.remove();
        refs.push(new WeakRef(player));
      }
      engine.playbacks = [];
      engine.stages = [];
      Object.assign(globalThis, { refs });
      return refs.length;
    });
    const devtools = await on.page.context().newCDPSession(on.page);
    const alive = async () => {
      await devtools.send("HeapProfiler.collectGarbage");
      return on.page.evaluate("refs.filter((ref) => ref.deref()).length");
    };
    expect(players).toBe(5);
    await expect.poll(alive).toBe(0);
  });

  test("focus() gives it the keyboard", async () => {
    await on.shown();
    await on.get((player) => player.focus());
    await on.page.keyboard.press("l");
    expect(await on.get((player) => [player.loop, player.matches(":focus-within")])).toEqual([true, true]);
  });

  test("two players on a page know nothing of each other", async () => {
    await on.put('<meshreel-player id="a" src="a.reel" controls></meshreel-player><meshreel-player id="b" src="b.reel" controls></meshreel-player>');
    await on.page.locator("#b .picture").focus();
    await on.page.keyboard.press("k");
    await on.page.keyboard.press("l");
    const states = await on.page.evaluate(() => [...document.querySelectorAll("meshreel-player")].map((player) => [player.paused, player.loop]));
    expect(states).toEqual([[true, false], [false, true]]);
  });

  test("autoplay plays, but not for those who want less motion", async () => {
    await on.put('<meshreel-player src="walk.reel" autoplay></meshreel-player>');
    expect(await on.get((player) => player.paused)).toBe(false);
    await on.page.emulateMedia({ reducedMotion: "reduce" });
    await on.put('<meshreel-player src="walk.reel" autoplay></meshreel-player>');
    expect(await on.get((player) => player.paused)).toBe(true);
  });

  test("events come as a media element gives them", async () => {
    await on.put('<meshreel-player></meshreel-player>', false);
    await on.get((player) => {
      const told: string[] = [];
      Object.assign(globalThis, { told });
      for (const type of ["loadstart", "loadedmetadata", "canplay", "play", "playing", "pause", "seeking", "seeked", "ended", "emptied"]) {
        player.addEventListener(type, () => told.push(type));
      }
      player.src = "walk.reel";
    });
    await on.eventually((player) => player.readyState === 4);
    await on.get((player) => void (player.currentTime = 1.9));
    await on.eventually((player) => !player.seeking);
    await on.get((player) => player.play());
    await on.eventually((player) => player.ended);
    await on.get((player) => player.load());
    expect(await on.page.evaluate("told.join(' ')")).toMatch(
      /^loadstart loadedmetadata canplay seeking seeked play playing pause ended emptied loadstart/, // it may be further by now
    );
    expect(await on.page.locator("button.play").count()).toBe(1);
  });

  test("at its end it offers to play again", async () => {
    await on.shown();
    await on.get((player) => void (player.currentTime = 1.95));
    await on.press("k");
    await on.eventually((player) => player.ended);
    await expect.poll(() => on.page.locator("button.play").getAttribute("aria-label")).toBe("Replay");
    await on.page.locator("button.play").click();
    await on.eventually((player) => !player.ended && player.currentTime < 1);
  });

  test("properties set before the element is defined or the source is there are kept", async () => {
    await on.put('<meshreel-player src="walk.reel" speed="2" layers="1" interpolate="off" loop mode="normal" t></meshreel-player>');
    const { playbackRate, layers, interpolate, loop } = await on.page.evaluate(() => engine.playbacks[0]!);
    expect({ playbackRate, layers, interpolate, loop }).toEqual({ playbackRate: 2, layers: 1, interpolate: false, loop: true });
    expect(await on.page.evaluate(() => engine.stages[0]!.mode)).toBe("normal");
    const time = await on.page.evaluate(async () => {
      const player = document.createElement("meshreel-player");
      player.currentTime = 0.5;
      player.src = "walk.reel";
      player.currentTime = 0.75;
      document.body.append(player);
      await new Promise((done) => player.addEventListener("canplay", done));
      return player.currentTime;
    });
    expect(time).toBe(0.75);
  });

  test("an axis that points up reaches the picture, and is the file's again when it is taken away", async () => {
    await on.put('<meshreel-player src="walk.reel" up="z"></meshreel-player>');
    const told = await on.get((player) => {
      const stage = engine.stages[0]!;
      const seen = [stage.up];
      for (const axis of ["-y", "x", null]) {
        if (axis === null) player.up = null;
        else player.setAttribute("up", axis);
        seen.push(stage.up);
      }
      return seen;
    });
    expect(told).toEqual(["z", "-y", "-y", null]);
  });

  test("a camera, a mode or a number of layers that is none leaves what was set, and warns", async () => {
    await on.put('<meshreel-player src="walk.reel" controls mode="x" layers="1" camera="1,2,3,0,0,0"></meshreel-player>');
    await on.page.locator(".toast", { hasText: 'mode "x" is ignored' }).waitFor();
    const told = await on.get((player) => {
      const messages: string[] = [];
      player.addEventListener("warning", (event) => messages.push((event as CustomEvent<Error>).detail.message));
      player.mode = "normal";
      engine.stages[0]!.camera = "7,7,7,0,0,0"; // somebody has moved it
      player.setAttribute("camera", "1,2");
      player.setAttribute("mode", "pink");
      player.setAttribute("layers", "high");
      player.layers = NaN;
      const { mode, layers, camera } = player;
      return { messages, mode, layers, camera, attributes: ["mode", "layers", "camera"].map((name) => player.getAttribute(name)) };
    });
    expect(told.messages.map((message) => message.split(" is ignored: give ")[0])).toEqual(
      ['camera "1,2"', 'mode "pink"', 'layers "high"', 'layers "NaN"'],
    );
    expect(told).toMatchObject({ mode: "normal", layers: 1, camera: "7,7,7,0,0,0", attributes: ["normal", "1", "1,2,3,0,0,0"] });
    expect(await on.page.evaluate(() => [engine.stages[0]!.mode, engine.playbacks[0]!.layers])).toEqual(["normal", 1]);
    await on.get((player) => player.removeAttribute("mode"));
    expect(await on.page.evaluate(() => engine.stages[0]!.mode)).toBe("shaded");
  });

  test("playing without a source is refused with a reason", async () => {
    await on.put("<meshreel-player></meshreel-player>", false);
    expect(await on.get((player) => player.play().catch((error: Error) => error.message))).toContain("set src");
    expect(await on.get((player) => [player.duration, player.paused, player.readyState])).toEqual([NaN, true, 0]);
    expect(await on.get((player) => player.screenshot().catch((error: Error) => error.message))).toContain("no picture");
  });

  test("an address that is none is told as any other that does not lead to a file", async () => {
    await on.put('<meshreel-player src="http://[404" controls></meshreel-player>', false);
    await on.page.getByRole("alert").waitFor();
    expect(await on.get((player) => [player.src, player.error!.message])).toEqual(["http://[404", "http://[404: not found (404), check the address"]);
  });

  test("a turn that is no number is refused, and the camera stays where it is", async () => {
    await on.shown();
    const told = await on.get((player) =>
      [[NaN, 0], [0, Infinity], [0, 0, 0], [0, 0, -1], [0, 0, NaN]].map((turn) => {
        try {
          player.orbit(...(turn as [number, number]));
          return "turned";
        } catch (error) {
          return (error as Error).name;
        }
      }),
    );
    expect(told).toEqual(Array.from({ length: 5 }, () => "TypeError"));
    expect(await on.page.evaluate(() => engine.stages[0]!.orbits)).toEqual([]);
  });

  test("one that played when it was taken out plays on where it was, with preload=none too", async () => {
    for (const preload of ["none", "auto"]) {
      await on.put(`<meshreel-player src="walk.reel" preload="${preload}" controls></meshreel-player>`, false);
      await on.get((player) => {
        player.currentTime = 1;
        return player.play();
      });
      await on.eventually((player) => player.readyState === 4 && player.currentTime > 1.1);
      const left = await on.get(async (player) => {
        player.remove();
        await new Promise((done) => setTimeout(done, 50));
        const { currentTime, paused } = player;
        document.body.append(player);
        return { currentTime, paused };
      });
      expect(left.paused).toBe(true);
      expect(left.currentTime).toBeGreaterThan(1.1);
      await on.eventually((player) => player.readyState === 4 && !player.paused);
      expect(await on.get((player) => player.currentTime)).toBeGreaterThanOrEqual(left.currentTime);
    }
  });

  test("with preload=none one that was open and paused is open again, and one that was not is not", async () => {
    await on.put('<meshreel-player src="walk.reel" preload="none" controls></meshreel-player>', false);
    const putAgain = () => on.get(async (player) => {
      player.remove();
      await new Promise((done) => setTimeout(done, 50));
      document.body.append(player);
      await new Promise((done) => setTimeout(done, 50));
      return player.readyState;
    });
    expect(await putAgain()).toBe(0);
    await on.get(async (player) => {
      await player.play();
      player.pause();
    });
    await on.eventually((player) => player.readyState === 4);
    expect(await putAgain()).toBe(4);
    expect(await on.get((player) => player.paused)).toBe(true);
    await on.get((player) => void (player.src = "other.reel"));
    await on.page.waitForTimeout(50);
    expect(await on.get((player) => player.readyState)).toBe(0);
  });

  test("preload=none fetches only when somebody plays", async () => {
    await on.put('<meshreel-player src="walk.reel" preload="none" controls></meshreel-player>', false);
    await on.page.waitForTimeout(100);
    expect(await on.page.evaluate(() => engine.playbacks.length)).toBe(0);
    await on.page.locator("button.big").click();
    await on.eventually((player) => !player.paused && player.readyState === 4);
  });
});
