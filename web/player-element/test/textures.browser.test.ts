// The built player with textured recordings, as Chromium's own decoders give them: each frame in its own picture.

import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";

import { Head } from "@meshreel/player-core/format/reader";
import { resealed } from "../../player-core/test/resealed.ts";
import { noise } from "../../player-core/test/server.ts";
import { describeInBrowser } from "../../test/browser.ts";
import { hasPython, runPython } from "../../test/python.ts";
import { Site } from "./product.ts";

const FRAMES = 8;
const NEAR = 14; // of 255, between what Python and the browser make of a picture
const ROOM_FRAMES = 10; // of a room that grows bright, with one picture for two frames
/** What the decoder of AV1 does in a browser that has none. */
const WITHOUT_AV1 = (): void => {
  const ask = VideoDecoder.isConfigSupported.bind(VideoDecoder);
  VideoDecoder.isConfigSupported = (config) => (config.codec.startsWith("av01") ? Promise.resolve({ supported: false, config }) : ask(config));
};
const WITHOUT_WEBCODECS = (): void => void Reflect.deleteProperty(globalThis, "VideoDecoder");

describeInBrowser("the player and textures", () => {
  const site = new Site();
  let file: Uint8Array;
  let light: readonly number[]; // means of the room's texture
  beforeAll(async () => {
    await site.open();
    if (!hasPython) return;
    const make = (...values: readonly (string | number)[]): { file: string; means: readonly number[] } =>
      JSON.parse(runPython(new URL("../../player-core/test/textured.py", import.meta.url), ...values).toString());
    file = Uint8Array.from(Buffer.from(make(FRAMES, 4).file, "base64"));
    site.write("textured.reel", file);
    const room = make("room", ROOM_FRAMES);
    site.write("room.reel", Buffer.from(room.file, "base64"));
    light = room.means;
  }, 240_000);
  afterAll(() => site.close());

  const open = async (more = "", scripts: Parameters<Site["visit"]>[1] = [], file = "textured"): Promise<{ page: Page; errors: string[] }> => {
    const found = await site.visit(`player/index.html?src=/${file}.reel&background=white&controls=0${more}`, scripts);
    await found.page.waitForFunction(() => (document.querySelector("meshreel-player")!.statistics?.triangles ?? 0) > 0);
    return found;
  };

  /** The mean red and the spread of green over the body's pixels at a frame. */
  const lookAt = (page: Page, frame: number): Promise<[number, number]> =>
    page.evaluate(async (wanted) => {
      const player = document.querySelector("meshreel-player")!;
      const arrived = new Promise((done) => player.addEventListener("seeked", done, { once: true }));
      player.currentTime = wanted / player.info!.frameRate;
      await arrived;
      const picture = await createImageBitmap(await player.screenshot());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      const [reds, greens]: [number[], number[]] = [[], []];
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 2] > 120) continue; // not the body, whose blue is 60
        reds.push(data[i]);
        greens.push(data[i + 1]);
      }
      greens.sort((a, b) => a - b);
      return [reds.reduce((sum, red) => sum + red, 0) / reds.length, greens[Math.floor(0.9 * greens.length)] - greens[Math.floor(0.1 * greens.length)]];
    }, frame);

  test.skipIf(!hasPython).each([
    ["AV1", []],
    ["H.264", [WITHOUT_AV1]],
  ] as const)("shows each frame in its own picture from %s, to and fro", async (codec, scripts) => {
    const { page, errors } = await open("", scripts);
    for (const frame of [1, 7, 0, 5, 4, 2]) {
      const [red, spread] = await lookAt(page, frame);
      expect(Math.abs(red - (40 + Math.floor((200 * frame) / (FRAMES - 1)))), `frame ${frame}`).toBeLessThan(NEAR);
      expect(spread).toBeGreaterThan(110); // of checks of 0 and 160
    }
    const { textures, textureCodec, textureReason } = (await page.evaluate(() => document.querySelector("meshreel-player")!.statistics))!;
    expect([textures, textureCodec, textureReason]).toEqual(["shown", codec, codec === "AV1" ? "" : "this browser decodes no AV1"]);
    expect(errors).toEqual([]);
    await page.close();
  });

  test.skipIf(!hasPython).each([
    ["AV1", []],
    ["H.264", [WITHOUT_AV1]],
  ] as const)("goes on behind a packet of %s that is nonsense", async (codec, scripts) => {
    const kind = codec === "AV1" ? "pictures" : "compatible";
    const chunks = Head.parse(file).chunks.filter((chunk) => chunk.kind === kind);
    site.write("hostile.reel", resealed(file, chunks.slice(0, 1), (payload) => noise(payload.length >> 1, 7).forEach((byte, k) => (payload[payload.length - 1 - k] ^= byte))));
    const { page, errors } = await open("", scripts, "hostile");
    const [red] = await lookAt(page, FRAMES - 1);
    expect(Math.abs(red - 240)).toBeLessThan(60); // by its vertices or by what the decoder made of it
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.error)).toBeNull();
    expect(errors).toEqual([]);
    await page.close();
  });

  test.skipIf(!hasPython)("shows a room in the light of each moment, though nothing waits for it", async () => {
    const { page, errors } = await open("", [], "room");
    const seek = async (frame: number): Promise<void> => {
      await page.evaluate(async (wanted) => {
        const player = document.querySelector("meshreel-player")!;
        const arrived = new Promise((done) => player.addEventListener("seeked", done, { once: true }));
        player.currentTime = wanted / player.info!.frameRate;
        await arrived;
      }, frame);
      await page.waitForFunction(() => document.querySelector("meshreel-player")!.statistics!.backgroundLate === false);
    };
    const brightness = (): Promise<number> =>
      page.evaluate(async () => {
        const picture = await createImageBitmap(await document.querySelector("meshreel-player")!.screenshot());
        const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d")!;
        context.drawImage(picture, 0, 0);
        const { data } = context.getImageData(0, 0, picture.width, picture.height);
        let [sum, count] = [0, 0];
        for (let i = 0; i < data.length; i += 4) {
          if (data[i] > 250 && data[i + 1] > 250 && data[i + 2] > 250) continue; // nothing is drawn there
          sum += data[i] + data[i + 1] + data[i + 2];
          count++;
        }
        return sum / count;
      });
    await seek(ROOM_FRAMES - 1);
    await page.waitForTimeout(500); // statistics are of the last picture that was drawn
    const last = await brightness();
    for (const frame of [0, 5, 2]) {
      await seek(frame);
      const wanted = light[frame] / light[ROOM_FRAMES - 1];
      await expect.poll(async () => Math.abs((await brightness()) / last - wanted), { message: `frame ${frame}` }).toBeLessThan(0.07 * wanted);
    }
    expect(errors).toEqual([]);
    await page.close();
  });

  test.skipIf(!hasPython).each([
    ["off", "&textures=off", []],
    ["unsupported", "", [WITHOUT_WEBCODECS]],
  ] as const)("shows the colours of vertices where textures are %s", async (state, more, scripts) => {
    const { page, errors } = await open(more, scripts);
    const [red] = await lookAt(page, 7);
    expect(red).toBeGreaterThan(180);
    expect(await page.evaluate(() => document.querySelector("meshreel-player")!.statistics!.textures)).toBe(state);
    expect(errors).toEqual([]);
    await page.close();
  });
});
