// Chromium decodes textures by software in time. `MESHREEL_ALL=1 npx vitest run video_speed` prints how many pictures a second.

import { afterAll, beforeAll, expect } from "vitest";

import { describeInBrowser, openEmptyPage, type OpenPage } from "../../test/browser.ts";
import { runPython } from "../../test/python.ts";
import { slowTest } from "../../test/slow.ts";
import { CODECS, configFor } from "../src/format/renditions.ts";
import type { Rendition } from "../src/types.ts";

const [FRAMES, SIDE] = [60, 1024];
const LEAST = 60; // pictures a second
const PASSES = 3; // the best counts: the machine of a test is shared

describeInBrowser("a video of textures", () => {
  let opened: OpenPage;
  beforeAll(async () => {
    opened = await openEmptyPage();
  });
  afterAll(() => opened.close());

  /** Pictures a second of a decoder without hardware, from the first packet to the last picture; none is drawn. */
  const rateOf = (config: VideoDecoderConfig, packets: readonly string[]): Promise<number> =>
    opened.page.evaluate(async ([config, packets]) => {
      const chunks = packets.map((text, k) => {
        const data = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
        return new EncodedVideoChunk({ type: k === 0 ? "key" : "delta", timestamp: k, data });
      });
      let count = 0;
      const decoder = new VideoDecoder({ output: (image) => (image.close(), count++), error: (error) => { throw error; } });
      decoder.configure({ ...config, hardwareAcceleration: "prefer-software" });
      const start = performance.now();
      for (const chunk of chunks) decoder.decode(chunk);
      await decoder.flush();
      const rate = (1000 * count) / (performance.now() - start);
      decoder.close();
      return count === chunks.length ? rate : NaN;
    }, [config, packets] as const);

  slowTest(`of ${SIDE} x ${SIDE} texels is decoded at 60 pictures a second or more`, async () => {
    const videos = JSON.parse(runPython(new URL("video.py", import.meta.url), FRAMES, SIDE).toString()) as Record<Rendition, string[]>;
    for (const kind of ["pictures", "compatible"] as const) {
      const packets = videos[kind];
      const config = configFor(kind, Buffer.from(packets[0], "base64"));
      const rates: number[] = [];
      for (let pass = 0; pass < PASSES; pass++) rates.push(await rateOf(config, packets));
      const bytes = packets.reduce((sum, packet) => sum + Buffer.byteLength(packet, "base64"), 0);
      console.log(`${CODECS[kind]} (${config.codec}), ${packets.length} pictures of ${bytes} bytes: ${rates.map((rate) => rate.toFixed(0)).join(", ")} a second`);
      expect(Math.max(...rates)).toBeGreaterThanOrEqual(LEAST);
    }
  }, 600_000);
});
