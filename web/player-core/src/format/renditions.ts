// Videos of textures: which of them this browser decodes, and how its decoder is set up for one.

import { headersOf } from "./video_headers.ts";
import { FormatError } from "../errors.ts";
import { RENDITIONS } from "./reader.ts";
import type { Rendition } from "../types.ts";

/** Texels, of the side of a texture, as in geometry/atlas.py. */
export const MOST_SIDE = 2048;

export const CODECS: Readonly<Record<Rendition, "AV1" | "H.264">> = { pictures: "AV1", compatible: "H.264" };

/** 8 bits, 4:2:0, and the level of the largest texture: 5.0. */
const LARGEST: Readonly<Record<Rendition, string>> = { pictures: "av01.0.12M.08", compatible: "avc1.640032" };

/** The renditions that this browser decodes; null where it has no WebCodecs. */
export async function decodable(): Promise<readonly Rendition[] | null> {
  if (typeof VideoDecoder === "undefined") return null;
  const asked = RENDITIONS.map((kind) => VideoDecoder.isConfigSupported(configOf(kind, LARGEST[kind])).then(({ supported }) => supported === true, () => false));
  const answers = await Promise.all(asked);
  return RENDITIONS.filter((_, k) => answers[k]);
}

/** Configuration of a decoder for the video that begins with a packet. */
export function configFor(kind: Rendition, packet: Uint8Array): VideoDecoderConfig {
  const [header] = headersOf(kind, packet);
  return configOf(kind, header?.codec ?? LARGEST[kind]);
}

/** Texels of a picture as a packet says, 0 where it does not. FormatError where they are more than those of a texture. */
export function texelsOf(kind: Rendition, packet: Uint8Array): number {
  return headersOf(kind, packet).reduce((most, { width, height }) => {
    if (Math.max(width, height) > MOST_SIDE) throw new FormatError(`a picture of ${width} x ${height}, over ${MOST_SIDE}`);
    return Math.max(most, width * height);
  }, 0);
}

function configOf(kind: Rendition, codec: string): VideoDecoderConfig {
  return { codec, optimizeForLatency: true, ...(kind === "compatible" ? { avc: { format: "annexb" } } : {}) };
}
