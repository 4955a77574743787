// Names, focus, contrast and sizes: whether everybody can use the controls.

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { expect, test } from "vitest";
import { describeOnPage } from "./fixture.ts";

describeOnPage("look of <meshreel-player>", (on) => {
  test("every control has a name, and none is reached by a reader without one", async () => {
    await on.shown("stats");
    await on.page.getByRole("button", { name: "Settings" }).click();
    const unnamed = await on.get((player) =>
      [...player.shadowRoot!.querySelectorAll("button, select, input:not([aria-hidden])")]
        .filter((node) => !node.getAttribute("aria-label") && !node.textContent!.trim()).length);
    expect(unnamed).toBe(0);
  });

  test("the parts are those of the documentation", async () => {
    await on.shown("stats");
    const parts = await on.get((player) =>
      [...player.shadowRoot!.querySelectorAll("[part]")].flatMap((node) => [...node.part]));
    const text = readFileSync(fileURLToPath(new URL("../../../docs/player.md", import.meta.url)), "utf8");
    const section = text.slice(text.indexOf("`::part()` reaches"), text.indexOf("```css"));
    const documented = [...section.matchAll(/`([a-z-]+)`/g)].map((match) => match[1]!);
    expect(new Set(documented)).toEqual(new Set([...parts, "toast"])); // a toast is there only now and then
  });

  test("the focus is seen on everything that takes it", async () => {
    await on.shown();
    await on.page.locator(".picture").focus();
    const seen: string[] = [];
    for (let i = 0; i < 9; i++) {
      await on.page.keyboard.press("Tab");
      seen.push(await on.get((player) => {
        const node = player.shadowRoot!.activeElement!;
        return `${node.className.split(" ").at(-1)}:${getComputedStyle(node).outlineStyle}`;
      }));
    }
    expect(seen).toEqual([
      "big-play", "range", "play", "step", "step", "tool", "tool", "tool", "tool",
    ].map((name) => `${name === "big-play" ? "big" : name}:solid`));
  });

  test("text stands out in dark and in light", async () => {
    for (const [scheme, theme] of [["dark", ""], ["light", ""], ["dark", "light"], ["light", "dark"]] as const) {
      await on.page.emulateMedia({ colorScheme: scheme });
      await on.shown(`stats ${theme && `theme="${theme}"`}`);
      const [text, quiet, panel] = await on.get((player) => {
        const style = (selector: string) => getComputedStyle(player.shadowRoot!.querySelector(selector)!);
        return [style(".time").color, style(".time .all").color, style(".settings").backgroundColor];
      });
      expect(contrast(text!, panel!)).toBeGreaterThan(7);
      expect(contrast(quiet!, panel!)).toBeGreaterThan(4.5);
      expect(luminance(panel!) < 0.2).toBe((theme || scheme) === "dark");
      expect(await on.page.evaluate(() => engine.stages[0]!.background)).toBe(
        (theme || scheme) === "dark" ? "rgb(20, 23, 28)" : "rgb(233, 236, 240)");
    }
  });

  test("the scene's background follows the scheme, the property and the attribute", async () => {
    await on.shown();
    await on.page.emulateMedia({ colorScheme: "light" });
    const background = () => on.page.evaluate(() => engine.stages[0]!.background);
    await expect.poll(background).toBe("rgb(233, 236, 240)");
    await on.get((player) => player.style.setProperty("--meshreel-background", "navy"));
    await on.get((player) => void (player.theme = "light"));
    expect(await background()).toBe("rgb(0, 0, 128)");
    await on.get((player) => void (player.background = "#102030"));
    expect(await background()).toBe("rgb(16, 32, 48)");
  });

  test("at 240 pixels everything is still reached, and nothing sticks out", async () => {
    await on.page.setViewportSize({ width: 240, height: 200 });
    await on.page.evaluate(() => void (document.body.style.margin = "0"));
    await on.put('<meshreel-player src="walk.reel" controls style="width:240px;height:180px;aspect-ratio:auto"></meshreel-player>');
    const outside = await on.get((player) =>
      [...player.shadowRoot!.querySelectorAll(".row > *")].filter((node) => {
        const { left, right, width } = node.getBoundingClientRect();
        return width > 0 && (left < 0 || right > 240);
      }).length);
    expect(outside).toBe(0);
    expect(await on.page.locator(".row button.loop").isVisible()).toBe(false);
    await on.page.getByRole("button", { name: "Settings" }).click();
    await on.page.locator(".settings button.loop").click();
    await on.page.locator(".settings button.stats").click();
    expect(await on.get((player) => [player.loop, player.stats])).toEqual([true, true]);
  });

  test("buttons are big enough for fingers", async () => {
    await on.shown();
    const sizes = await on.get((player) =>
      [...player.shadowRoot!.querySelectorAll(".row .button")].filter((node) => node.getClientRects().length).map((node) => Math.min(node.getBoundingClientRect().width, node.getBoundingClientRect().height)));
    expect(Math.min(...sizes)).toBeGreaterThanOrEqual(40);
  });

  test("the controls fade while it plays and nobody moves, and come back", async () => {
    await on.shown("loop");
    await on.page.mouse.move(300, 100);
    await on.press("k");
    const opacity = () => on.page.locator(".bar").evaluate((bar) => Number(getComputedStyle(bar).opacity));
    await expect.poll(opacity).toBe(0);
    await on.page.mouse.move(310, 120);
    await expect.poll(opacity).toBe(1);
  });

  test("on touch a tap brings the controls back for long enough to pause by another", async () => {
    const input = await on.page.context().newCDPSession(on.page);
    await input.send("Emulation.setTouchEmulationEnabled", { enabled: true });
    const tap = async (selector: string) => {
      const box = (await on.page.locator(selector).first().boundingBox())!;
      await input.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [{ x: box.x + box.width / 2, y: box.y + box.height / 2 }] });
      await input.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    };
    const opacity = () => on.page.locator(".bar").evaluate((bar) => Number(getComputedStyle(bar).opacity));
    await on.page.setViewportSize({ width: 390, height: 844 });
    await on.shown("loop");
    await tap(".picture");
    await expect.poll(() => on.get((player) => player.paused)).toBe(false);
    await expect.poll(opacity).toBe(0);
    await tap(".picture");
    await on.page.waitForTimeout(1000); // longer than the bar takes to fade
    expect([await opacity(), await on.get((player) => player.paused)]).toEqual([1, false]);
    await tap(".row .play");
    await expect.poll(() => on.get((player) => player.paused)).toBe(true);
    await input.send("Emulation.setTouchEmulationEnabled", { enabled: false });
    await input.detach();
  });

  test("without controls there are none, and keys are the page's", async () => {
    await on.put('<meshreel-player src="walk.reel"></meshreel-player>');
    expect(await on.page.locator(".bar").isVisible()).toBe(false);
    expect(await on.page.locator("button.big").isVisible()).toBe(false);
    await on.press("k");
    expect(await on.get((player) => player.paused)).toBe(true);
    await on.get((player) => void (player.controls = true));
    await on.page.locator(".bar").waitFor();
    await on.press("k");
    expect(await on.get((player) => player.paused)).toBe(false);
  });
});

/** Relative luminance and contrast as WCAG 2 defines them. */
function luminance(colour: string): number {
  const [red, green, blue] = colour.match(/[\d.]+/g)!.slice(0, 3).map((part) => {
    const value = Number(part) / 255;
    return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * red! + 0.7152 * green! + 0.0722 * blue!;
}

function contrast(one: string, other: string): number {
  const [dark, bright] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (bright! + 0.05) / (dark! + 0.05);
}
