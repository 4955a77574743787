// The numbers of the statistics overlay, as lines of a name and a value.

import type { Info, Stats, TextureState, TextureStats } from "@meshreel/player-core/types";
import { formatAmount, formatCount, formatRate } from "./format.ts";
import type { PictureStats } from "./stage.ts";

export interface Statistics extends Stats, PictureStats {
  readonly fps: number; // pictures in the last second
  readonly frameMs: number; // JavaScript for a picture on the main thread, median
  readonly drawn: number; // pictures since the view was made
}

/** Lines of the overlay; `frame` counts from 0. */
export function statisticsLines(stats: Statistics, info: Info | null, frame: number): (readonly [string, string])[] {
  return [
    ["Frame", info ? `${frame + 1} of ${info.frameCount}, ${Number(info.frameRate.toFixed(2))} fps` : "none yet"],
    ["Bitrate", stats.mbps > 0 ? formatRate(stats.mbps) : "not known yet"],
    ["Connection speed", stats.bandwidthMbps > 0 ? formatRate(stats.bandwidthMbps) : "not known yet"],
    ["Downloaded", info ? `${formatAmount(stats.fetchedBytes, "B")} of ${formatAmount(info.size, "B")}` : formatAmount(stats.fetchedBytes, "B")],
    ["Decode", `${stats.decodeMs.toFixed(1)} ms a group, load ${(stats.decodeLoad * 100).toFixed(0)} %`],
    ["Buffer", `${stats.bufferedSeconds.toFixed(1)} s, ${formatCount(stats.stalls)} ${stats.stalls === 1 ? "stall" : "stalls"}`],
    ["Layers", layersText(stats, info?.mostLayers ?? 0)],
    ["Colours", colorsOf(stats, info)],
    ["Triangles", formatCount(stats.triangles)],
    ["Display", stats.fps > 0 ? `${formatCount(stats.fps)} fps, ${stats.frameMs.toFixed(1)} ms each` : "still"],
    ["GPU memory", formatAmount(stats.gpuBytes, "B")],
    ["Skipped groups", formatCount(stats.skippedGroups)],
  ];
}

/** Layers beyond the first, of those that there are; all of the file's where nothing of what is shown is left out. */
function layersText({ layers, wholeLayers }: Statistics, most: number): string {
  if (most === 0) return "one only";
  return layers >= wholeLayers ? `${most} of ${most}` : `${layers} of ${wholeLayers}`;
}

function colorsOf(stats: Statistics, info: Info | null): string {
  if (stats.splats > 0) return `${formatCount(stats.splats)} splats, ordered in ${stats.sortMs.toFixed(1)} ms`;
  return info?.hasColors ? colorsText(stats) : "none";
}

const WITHOUT: Readonly<Record<Exclude<TextureState, "shown">, string>> = {
  none: "of vertices",
  off: "of vertices: textures are off",
  unsupported: "of vertices",
  slow: "of vertices",
  damaged: "of vertices: the texture is damaged",
  "left out": "of vertices: textures come with more layers",
  far: "of vertices: textures are too small to be seen",
  late: "of vertices: the texture is not decoded yet",
};

function colorsText({ textures, textureCodec, textureReason, backgroundLate }: TextureStats): string {
  const why = textureReason === "" || textures === "off" ? "" : `: ${textureReason}`;
  if (textures !== "shown") return textures === "unsupported" || textures === "slow" ? WITHOUT[textures] + why : WITHOUT[textures];
  return `${textureCodec} texture${backgroundLate ? ", the background's is late" : ""}${why}`;
}
