// Chromium decodes the pictures of the golden files to the planes that Python has, from AV1 and from H.264.

import { readFileSync } from "node:fs";

import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser, openEmptyPage, type OpenPage } from "../../test/browser.ts";
import { configFor } from "../src/format/renditions.ts";
import { Pictures } from "../src/format/layout.gen.ts";
import { Head, isVideo } from "../src/format/reader.ts";
import { unpackAll } from "../src/format/records.ts";
import type { Rendition } from "../src/types.ts";
import { ROOT } from "./tools.ts";

/** One video of a file: its packets, and the digests of their planes. */
interface Video {
  readonly kind: Rendition;
  readonly packets: number[][];
  readonly planes: string[];
}

/** The videos of a file, those of predicted groups joined. */
function videosOf(name: string): Video[] {
  const data = new Uint8Array(readFileSync(`${ROOT}/conformance/v1/colored/${name}.reel`));
  const golden = JSON.parse(readFileSync(`${ROOT}/conformance/v1/colored/${name}.json`, "utf8")).planes as Record<string, string[]>;
  const videos: Video[] = [];
  const last = new Map<number, Video>();
  for (const piece of Head.parse(data).pieces.filter(isVideo)) {
    const { packets } = unpackAll(Pictures, data.slice(piece.offset, piece.offset + piece.size));
    const before = piece.frameCount > 0 ? last.get(piece.dependsOn[2]) : undefined;
    const video = before ?? { kind: piece.kind, packets: [], planes: [] };
    if (before === undefined) videos.push(video);
    video.packets.push(...packets.map((packet) => [...packet]));
    video.planes.push(...golden[piece.number].splice(0, packets.length));
    last.set(piece.number, video);
  }
  expect(Object.values(golden).flat()).toEqual([]);
  return videos;
}

describeInBrowser("pictures in Chromium", () => {
  let opened: OpenPage;
  beforeAll(async () => {
    opened = await openEmptyPage();
  });
  afterAll(() => opened.close());

  test.each(["textures", "scene"])("of colored/%s.reel are the same planes", async (name) => {
    for (const { kind, packets, planes } of videosOf(name)) {
      const found = await opened.page.evaluate(async ([config, packets]) => {
        const pictures: Promise<string>[] = [];
        const digest = async (image: VideoFrame): Promise<string> => {
          const { width, height } = image.visibleRect!;
          if (image.format !== "I420") return String(image.format);
          const bytes = new Uint8Array((width * height * 3) / 2);
          const half = { offset: width * height, stride: width / 2 };
          await image.copyTo(bytes, { layout: [{ offset: 0, stride: width }, half, { ...half, offset: (half.offset * 5) / 4 }] });
          image.close();
          const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
          return [...hash].map((byte) => byte.toString(16).padStart(2, "0")).join("");
        };
        const decoder = new VideoDecoder({ output: (image) => pictures.push(digest(image)), error: (error) => pictures.push(Promise.resolve(error.message)) });
        decoder.configure(config);
        packets.forEach((packet, k) => decoder.decode(new EncodedVideoChunk({ type: k === 0 ? "key" : "delta", timestamp: k, data: Uint8Array.from(packet) })));
        await decoder.flush();
        return Promise.all(pictures);
      }, [configFor(kind, Uint8Array.from(packets[0])), packets] as const);
      expect(found).toEqual(planes);
    }
  });
});
