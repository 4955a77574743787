// Actions of keys and buttons.

import type { MeshreelPlayer } from "../element.ts";
import { recordingName } from "../format.ts";
import { type Action, seekStep } from "../keyboard.ts";
import { linkOf } from "../address.ts";
import { record } from "../record.ts";
import { cut } from "../section.ts";
import { modeName, nextMode } from "./choices.ts";

/** Interface of the controls for actions. */
export interface Surface {
  /** Says in a few words what was done. */
  tell(text: string): void;
  toggleHelp(): void;
  close(): void;
}

const TURN = Math.PI / 24; // of a key
const CLOSER = 1.15;
const LOUDER = 0.1; // of a key

type Act = (player: MeshreelPlayer, surface: Surface) => void;

const ACTS: Readonly<Record<Action, Act>> = {
  toggle: (player, surface) => togglePlay(player, surface),
  back: (player) => seekBy(player, -1),
  forward: (player) => seekBy(player, 1),
  first: (player) => void (player.currentTime = 0),
  last: (player) => lastFrame(player),
  previousFrame: (player) => player.step(-1),
  nextFrame: (player) => player.step(1),
  fullscreen: (player, surface) => void toggleFullscreen(player, surface),
  vr: (player, surface) => void toggleVr(player, surface),
  stats: (player) => void (player.stats = !player.stats),
  mode: (player, surface) => {
    player.mode = nextMode(player.mode, player.info);
    surface.tell(modeName(player.mode));
  },
  loop: (player, surface) => {
    player.loop = !player.loop;
    surface.tell(player.loop ? "Loop on" : "Loop off");
  },
  mute: (player, surface) => {
    player.muted = !player.muted;
    surface.tell(player.muted ? "Muted" : "Unmuted");
  },
  louder: (player, surface) => setVolume(player, surface, LOUDER),
  quieter: (player, surface) => setVolume(player, surface, -LOUDER),
  sectionFrom: (player, surface) => {
    player.section = cut(player, "from");
    surface.tell("Loop start set");
  },
  sectionTo: (player, surface) => {
    player.section = cut(player, "to");
    surface.tell("Loop end set");
  },
  sectionOff: (player, surface) => {
    player.section = null;
    surface.tell("Loop cleared");
  },
  frames: (player) => void (player.frames = !player.frames),
  autoRotate: (player) => void (player.autoRotate = !player.autoRotate),
  fly: (player, surface) => {
    player.fly = !player.fly;
    surface.tell(player.fly ? "Fly mode on: W A S D, Q E, drag" : "Fly mode off");
  },
  fit: (player) => player.fit(),
  turnLeft: (player) => player.orbit(-TURN, 0),
  turnRight: (player) => player.orbit(TURN, 0),
  turnUp: (player) => player.orbit(0, TURN),
  turnDown: (player) => player.orbit(0, -TURN),
  closer: (player) => player.orbit(0, 0, CLOSER),
  farther: (player) => player.orbit(0, 0, 1 / CLOSER),
  help: (_, surface) => surface.toggleHelp(),
  close: (_, surface) => surface.close(),
};

export function perform(action: Action, player: MeshreelPlayer, surface: Surface): void {
  ACTS[action](player, surface);
}

function togglePlay(player: MeshreelPlayer, surface: Surface): void {
  if (!player.paused && !player.ended) player.pause();
  else player.play().catch((error: Error) => { if (!player.error) surface.tell(error.message); });
}

function seekBy(player: MeshreelPlayer, direction: number): void {
  if (!(player.duration > 0)) return;
  const time = player.currentTime + direction * seekStep(player.duration);
  player.currentTime = Math.min(player.duration, Math.max(0, time));
}

function setVolume(player: MeshreelPlayer, surface: Surface, more: number): void {
  player.volume = Math.min(1, Math.max(0, player.volume + more));
  if (more > 0) player.muted = false;
  surface.tell(`Volume ${Math.round(100 * player.volume)} %`);
}

function lastFrame(player: MeshreelPlayer): void {
  if (player.info) player.step(player.info.frameCount); // held at the last; its time is the recording's to know
}

async function toggleFullscreen(player: MeshreelPlayer, surface: Surface): Promise<void> {
  try {
    if (document.fullscreenElement) await document.exitFullscreen();
    else await player.requestFullscreen();
  } catch {
    surface.tell("Full screen is not allowed here");
  }
}

export async function toggleVr(player: MeshreelPlayer, surface: Surface, passthrough = false): Promise<void> {
  if (player.presenting) player.exitVr();
  else if (await (passthrough ? player.arSupported() : player.vrSupported())) {
    await player.enterVr(passthrough).catch((error: Error) => surface.tell(`VR did not start: ${error.message}`));
  } else surface.tell("No headset found");
}

/** Puts a link to what is seen on the clipboard. */
export async function copyLink(player: MeshreelPlayer, surface: Surface): Promise<void> {
  try {
    await navigator.clipboard.writeText(linkOf(player));
    surface.tell("Link copied");
  } catch {
    surface.tell("Copying is not allowed here");
  }
}

/** Puts a command on the clipboard that makes the view of now the first one of the file, which a page cannot write. */
export async function copyView(player: MeshreelPlayer, surface: Surface): Promise<void> {
  const name = player.currentSrc === "" ? "" : recordingName(player.currentSrc);
  const file = /^\w[\w.+-]*$/.test(name) ? `${name}.reel` : "FILE.reel"; // nothing that a shell takes as its own
  try {
    await navigator.clipboard.writeText(`meshreel tag ${file} --view=${player.viewOfFile} -o view-${file}`);
    surface.tell("Command copied: run it to make this the first view");
  } catch {
    surface.tell("Copying is not allowed here");
  }
}

/** Saves the picture as a file named after recording and frame. */
export async function saveScreenshot(player: MeshreelPlayer, surface: Surface): Promise<void> {
  try {
    save(await player.screenshot(), `${recordingName(player.currentSrc)}-${player.currentFrame + 1}.png`);
    surface.tell("Screenshot saved");
  } catch (error) {
    surface.tell(`Screenshot failed: ${error instanceof Error ? error.message : error}`);
  }
}

/** Saves a video of one loop, seen as the viewer moves the camera meanwhile. */
export async function saveLoop(player: MeshreelPlayer, surface: Surface, canvas: HTMLCanvasElement): Promise<void> {
  try {
    const video = await record(player, canvas);
    save(video, `${recordingName(player.currentSrc)}.${video.type.startsWith("video/mp4") ? "mp4" : "webm"}`);
    surface.tell("Loop saved");
  } catch (error) {
    surface.tell(`No video: ${error instanceof Error ? error.message : error}`);
  }
}

function save(file: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
