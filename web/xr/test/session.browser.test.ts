// Pictures of both eyes are kept where MESHREEL_PICTURES names a folder.

import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { afterAll, afterEach, beforeAll, beforeEach, expect, test } from "vitest";
import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import type { SessionApi } from "./pages/session.ts";

type Hand = "left" | "right";
type State = ReturnType<SessionApi["state"]>;

let open: OpenPage;

/** Presses or lets go, and waits until the headset has told it. */
async function press(hand: Hand, button: string, value: 0 | 1): Promise<void> {
  await open.page.evaluate(([h, b, v]) => window.vr.button(h, b, v), [hand, button, value] as const);
  await frames(2);
}

async function move(hand: Hand, x: number, y: number, z: number): Promise<void> {
  await open.page.evaluate(([h, ...to]) => window.vr.pose(h, ...to), [hand, x, y, z] as const);
  await frames(2);
}

async function push(hand: Hand, x: number): Promise<void> {
  await open.page.evaluate(([h, to]) => window.vr.stick(h, to), [hand, x] as const);
  await frames(2);
}

const frames = (count: number): Promise<void> => open.page.evaluate((n) => window.vr.frames(n), count);
const content = (): Promise<ReturnType<SessionApi["content"]>> => open.page.evaluate(() => window.vr.content());
const told = (): Promise<string[]> => open.page.evaluate(() => window.vr.told());
const state = (): Promise<State> => open.page.evaluate(() => window.vr.state());

/** Both within one call, so that a slow machine does not make it a push that is held. */
async function tap(hand: Hand, x: number): Promise<void> {
  await open.page.evaluate(async ([h, to]) => {
    window.vr.stick(h, to);
    await window.vr.frames(1);
    window.vr.stick(h, 0);
    await window.vr.frames(1);
  }, [hand, x] as const);
}

async function enter(): Promise<void> {
  await open.page.evaluate(() => window.vr.enter());
  await frames(2);
}

async function openHeadset(): Promise<void> {
  open = await openPage(fileURLToPath(new URL("pages/session.ts", import.meta.url)));
  await open.page.setViewportSize({ width: 640, height: 360 }); // which the simulated headset takes as its own
  await open.page.waitForFunction(() => window.vr !== undefined);
}

function expectNear(found: readonly number[], wanted: readonly number[]): void {
  for (const [k, value] of wanted.entries()) expect(found[k]).toBeCloseTo(value, 4);
}

describeInBrowser("a browser without a headset", () => {
  beforeAll(openHeadset, 120_000);
  afterAll(async () => open?.close());

  test("is told so, and entering rejects and changes nothing", async () => {
    expect(await open.page.evaluate(() => window.vr.supported())).toBe(false);
    const before = await state();
    await expect(open.page.evaluate(() => window.vr.enter())).rejects.toThrow();
    expect(await state()).toEqual(before);
    expect(await told()).toEqual([]);
  });
});

describeInBrowser("a session in a simulated Quest 3", () => {
  let before: State;
  beforeAll(async () => {
    await openHeadset();
    await open.page.evaluate(() => {
      window.vr.install();
      window.vr.drawOnPage();
    });
    before = await state();
  });
  beforeEach(async () => {
    await open.page.evaluate(() => {
      window.vr.head(0, 1.6, 0);
      window.vr.pose("left", -0.25, 1.3, -0.4);
      window.vr.pose("right", 0.25, 1.3, -0.4);
    });
    await enter();
  });
  afterEach(async () => {
    await open.page.evaluate(() => window.vr.bare(false));
    await open.page.evaluate(() => window.vr.end());
    expect(await state()).toEqual(before);
    expect(open.errors).toEqual([]);
  });
  afterAll(async () => open?.close());

  test("both eyes see the recording, each from its own place", async () => {
    expect(await open.page.evaluate(() => window.vr.supported())).toBe(true);
    const { left, right, picture } = await open.page.evaluate(() => window.vr.eyes());
    if (process.env.MESHREEL_PICTURES) writeFileSync(join(process.env.MESHREEL_PICTURES, "vr-eyes.png"), Buffer.from(picture.split(",")[1], "base64"));
    for (const eye of [left, right]) {
      expect(eye.sphere).toBeGreaterThan(0.05);
      expect(eye.floor).toBeGreaterThan(0.05);
    }
    // 63 mm between the eyes; a picture of 8 : 9 and 90 degrees of height is 2.67 m wide at 1.5 m: 2.4 %.
    expect(left.middle - right.middle).toBeGreaterThan(0.018);
    expect(left.middle - right.middle).toBeLessThan(0.03);
  });

  test("there is a floor as far as the horizon", async () => {
    const { left } = await open.page.evaluate(() => window.vr.eyes());
    expect(left.sky[0]).toBeGreaterThan(0.8);
    expect(left.sky[1]).toBeLessThan(0.05);
  });

  test("a stick that is pushed forward goes where its hand points at the floor", async () => {
    await open.page.evaluate(() => window.vr.tilt("right", 45));
    await open.page.evaluate(() => window.vr.stick("right", 0, -1));
    await frames(3);
    const before = (await content()).position;
    await push("right", 0);
    const after = (await content()).position;
    // From 1.3 m above the floor and 0.4 m ahead, 45 degrees down: 1.7 m ahead, 0.25 m to the right.
    expectNear(after, [before[0]! - 0.25, before[1]!, before[2]! + 1.7]);
    expect(await told()).toEqual([]);
    await open.page.evaluate(() => window.vr.tilt("right", 0));
  });

  test("a panel at the left wrist shows how much was played", async () => {
    expect(await open.page.evaluate(() => window.vr.played(0.5))).toBeCloseTo(0.25, 2);
    expect(await open.page.evaluate(() => window.vr.played(1))).toBeCloseTo(0.5, 2);
    await move("left", 0, 1.45, -0.3);
    const { picture } = await open.page.evaluate(() => window.vr.eyes());
    if (process.env.MESHREEL_PICTURES) writeFileSync(join(process.env.MESHREEL_PICTURES, "vr-panel.png"), Buffer.from(picture.split(",")[1], "base64"));
  });

  test("a bare hand that pinches and moves takes it along, one that stays plays or pauses", async () => {
    const hand = (x: number, pinch: number): Promise<void> =>
      open.page.evaluate(async ([to, value]) => {
        window.vr.hand(to, 1.3, -0.4, value);
        await window.vr.frames(3);
      }, [x, pinch] as const);
    await open.page.evaluate(() => window.vr.bare(true));
    await hand(0.25, 0);
    const [before] = (await content()).position;
    await hand(0.25, 1);
    await hand(0.55, 1);
    await hand(0.55, 0);
    expect((await content()).position[0]! - before!).toBeCloseTo(0.3, 2);
    expect(await told()).toEqual([]);
    await hand(0.55, 1);
    await hand(0.55, 0);
    expect(await told()).toEqual(["toggle"]);
  });

  test("it asks for 90 pictures a second, where the headset has them", async () => {
    expect(await open.page.evaluate(() => window.vr.rate())).toBe(90);
  });

  test("the recording stands on the floor, its middle 1.5 m ahead, at true scale", async () => {
    expectNear((await content()).position, [0, 0.5, -1.5]);
    expect((await content()).scale).toBe(1);
  });

  test("a click of a thumbstick puts it in front of where the viewer is now", async () => {
    await open.page.evaluate(() => window.vr.head(2, 1.6, 1));
    await frames(2);
    expectNear((await content()).position, [0, 0.5, -1.5]);
    await press("left", "thumbstick", 1);
    expectNear((await content()).position, [2, 0.5, -0.5]);
    await press("left", "thumbstick", 0);
  });

  test("a hand that squeezes moves it, one that let go does not", async () => {
    await press("right", "squeeze", 1);
    await move("right", 0.55, 1.5, -0.8);
    expectNear((await content()).position, [0.3, 0.7, -1.9]);
    await press("right", "squeeze", 0);
    await move("right", 0, 1, 0);
    expectNear((await content()).position, [0.3, 0.7, -1.9]);
    expect(await content()).toMatchObject({ scale: 1, turn: 0 });
  });

  test("two hands that part scale it, and turn it where they turn", async () => {
    await press("left", "squeeze", 1);
    await press("right", "squeeze", 1);
    const [left, right] = [-0.25, 0.25];
    await move("left", left - 0.25, 1.3, -0.4);
    await move("right", right + 0.25, 1.3, -0.4);
    const scaled = await content();
    expect(scaled.scale).toBeGreaterThan(1.8);
    expect(scaled.scale).toBeLessThan(2.1);
    expect(scaled.turn).toBeCloseTo(0, 3);
    await move("right", 0.5, 1.3, -1.4); // 45 degrees, counter-clockwise from above
    expect((await content()).turn).toBeGreaterThan(0.7);
    expect((await content()).turn).toBeLessThan(0.85);
    await press("left", "squeeze", 0);
    await press("right", "squeeze", 0);
  });

  test("a trigger plays or pauses, once a pull", async () => {
    await press("left", "trigger", 1);
    await frames(3);
    await press("left", "trigger", 0);
    expect(await told()).toEqual(["toggle"]);
    await press("right", "trigger", 1);
    await press("right", "trigger", 0);
    expect(await told()).toEqual(["toggle"]);
  });

  test("a thumbstick steps a frame at a tap, seeks while it is held", async () => {
    await tap("right", 1);
    await tap("right", -1);
    expect(await told()).toEqual(["step 1", "step -1"]);
    await push("right", -1);
    await open.page.waitForTimeout(500);
    await frames(2);
    await push("right", 0);
    const seeks = await told();
    expect(seeks.length).toBeGreaterThan(0);
    expect(new Set(seeks)).toEqual(new Set(["seek -1"]));
  });

  test("the page's own loop stands still meanwhile and goes on afterwards", async () => {
    const before = await open.page.evaluate(() => window.vr.pageFrames());
    await frames(5);
    expect(await open.page.evaluate(() => window.vr.pageFrames())).toBe(before);
    await open.page.evaluate(() => window.vr.end());
    await open.page.waitForFunction((n) => window.vr.pageFrames() > n, before);
    expect(await told()).toEqual(["end false"]);
  });

  test("the headset's own button ends it all the same", async () => {
    await press("right", "squeeze", 1);
    await move("right", 0, 0, 0);
    await open.page.evaluate(() => window.vr.endFromDevice());
    expect(await told()).toEqual(["end false"]);
    expect(await state()).toEqual(before);
    await open.page.evaluate(() => window.vr.button("right", "squeeze", 0));
  });

  test("a session without a floor rejects, is ended, and leaves no trace", async () => {
    await open.page.evaluate(() => window.vr.end());
    await expect(open.page.evaluate(() => window.vr.enterWithoutSpace())).rejects.toThrow("no floor");
    expect(await open.page.evaluate(() => window.vr.active())).toBe(false);
    expect(await state()).toEqual(before);
    expect(await told()).toEqual([]);
    await enter();
    expect((await open.page.evaluate(() => window.vr.eyes())).left.sphere).toBeGreaterThan(0.05);
  });

  test("sessions one after another leave nothing on the GPU", async () => {
    await open.page.evaluate(() => window.vr.end());
    const memory = await open.page.evaluate(() => window.vr.memory());
    for (let round = 0; round < 3; round++) {
      await enter();
      await open.page.evaluate(() => window.vr.end());
    }
    expect(await open.page.evaluate(() => window.vr.memory())).toEqual(memory);
  });
});

describeInBrowser("a session in the viewer's own room", () => {
  const reticle = (): Promise<number[] | null> => open.page.evaluate(() => window.vr.reticle());
  /** Within one call, so that a slow machine does not make it a pull that is held. */
  const pull = (): Promise<void> =>
    open.page.evaluate(async () => {
      for (const value of [1, 0]) {
        window.vr.button("right", "trigger", value);
        await window.vr.frames(2);
      }
    });
  /** From 1.3 m above the recording's floor: 1 m ahead where the device knows that the real one is 0.3 m higher. */
  async function enterAr(): Promise<void> {
    await open.page.evaluate(() => {
      window.vr.head(0, 1.6, 0);
      window.vr.pose("right", 0.25, 1.3, -0.4);
      window.vr.tilt("right", 45);
    });
    await open.page.evaluate(() => window.vr.enter(true));
    await frames(4);
  }
  beforeAll(async () => {
    await openHeadset();
    await open.page.evaluate(() => window.vr.install());
  });
  afterEach(async () => {
    await open.page.evaluate(() => window.vr.end());
    expect(open.errors).toEqual([]);
  });
  afterAll(async () => open?.close());

  test("that the device does not know has the recording 1.5 m ahead, where the trigger plays it", async () => {
    await enterAr();
    expectNear((await content()).position, [0, 0.5, -1.5]);
    await pull();
    expect(await reticle()).toBe(null);
    expectNear((await content()).position, [0, 0.5, -1.5]);
    expect(await told()).toEqual(["toggle"]);
  });

  test("has a ring where a hand points at the floor; the trigger stands the recording there, at true scale and facing the viewer, then plays it", async () => {
    await open.page.evaluate(() => window.vr.knowRoom());
    await enterAr();
    expectNear((await reticle())!, [0.25, 0.3, -1.4]);
    await pull();
    expect(await reticle()).toBe(null);
    const placed = await content();
    expectNear(placed.position, [0.25, 0.8, -1.4]);
    expect(placed.scale).toBe(1);
    expect(placed.turn).toBeCloseTo(Math.atan2(-0.25, 1.4), 4);
    expect(await told()).toEqual([]);
    await pull();
    expect(await told()).toEqual(["toggle"]);
  });

  test("takes no wall for a floor, and a trigger that is held looks for another place", async () => {
    await enterAr();
    await pull();
    await press("right", "trigger", 1);
    await open.page.waitForTimeout(700);
    await press("right", "trigger", 0);
    await open.page.evaluate(() => window.vr.tilt("right", 0));
    await frames(2);
    expect(await reticle()).toBe(null);
    await open.page.evaluate(() => window.vr.tilt("right", 45));
    await move("right", -0.5, 1.3, -0.4);
    await pull();
    expectNear((await content()).position, [-0.5, 0.8, -1.4]);
    expect(await told()).toEqual([]);
  });

  test("keeps it where the device finds the place to be, also after a hand has moved it", async () => {
    await enterAr();
    await pull();
    await frames(3);
    const { turn } = await content();
    await open.page.evaluate(() => window.vr.correct(0.2, 0.5));
    await frames(3);
    expectNear((await content()).position, [0.45, 0.8, -1.4]);
    expect((await content()).turn).toBeCloseTo(turn + 0.5, 4);
    await press("right", "squeeze", 1);
    await move("right", 0.25, 1.3, -0.9);
    await press("right", "squeeze", 0);
    await open.page.evaluate(() => window.vr.correct(0.3, 0.5));
    await frames(3);
    expectNear((await content()).position, [0.55, 0.8, -1.9]);
  });
});
