// Application of changed attributes to the playback and the stage.

import type { Playback } from "@meshreel/player-core/types";
import type { Reflected } from "./reflected.ts";
import type { Stage } from "./stage.ts";

export function applyToPlayback(name: string, settings: Reflected, playback: Playback): void {
  if (name === "loop") playback.loop = settings.loop;
  if (name === "direction") playback.direction = settings.direction;
  if (name === "layers") playback.layers = settings.layers;
  if (name === "speed" || name === "playbackrate") playback.playbackRate = settings.playbackRate;
  if (name === "textures") playback.textures = settings.textures;
  if (name === "mode") playback.splats = settings.splats;
  if (name === "muted") playback.sound.muted = settings.muted;
  if (name === "volume") playback.sound.volume = settings.volume;
  if (name === "interpolate") playback.interpolate = settings.interpolate;
}

export function applyToStage(name: string, settings: Reflected, stage: Stage): void {
  if (name === "mode") stage.mode = settings.mode;
  if (name === "autorotate") stage.autoRotate = settings.autoRotate;
  if (name === "fly") stage.fly = settings.fly;
  if (name === "ground") stage.ground = settings.ground;
  if (name === "exposure") stage.exposure = settings.exposure;
  if (name === "up") stage.up = settings.up;
  if (name === "camera") stage.camera = settings.getAttribute("camera") ?? "";
}
