// A video of the canvas while a loop plays once, made by the browser.

import type { Sectioned } from "./section.ts";

const TYPES = ["video/mp4;codecs=avc1.64003E", "video/webm;codecs=vp9", "video/webm", "video/mp4"]; // those that most programs play first
const BITS = 16e6; // per second: hardly a trace of coding at 1920 x 1080 (guess)

/** False where the browser makes no videos. */
export function canRecord(): boolean {
  return "MediaRecorder" in globalThis && "captureStream" in HTMLCanvasElement.prototype;
}

/** The part of a player that it needs. */
export interface Recorded extends Sectioned, EventTarget {
  readonly error: Error | null;
  pause(): void;
}

/** Plays the section, or all, once in its direction, and gives what the canvas showed; less if the viewer pauses. It has no sound. */
export async function record(player: Recorded, canvas: HTMLCanvasElement): Promise<Blob> {
  const [from, to] = player.section ?? [0, player.duration];
  let way = player.direction === "reverse" ? -1 : 1;
  let turns = player.direction === "alternate" ? 2 : 1; // and jumps, until it is where it began
  let last = way > 0 ? from : to;
  player.pause();
  player.currentTime = last;
  await until(() => !player.seeking || player.error !== null);
  const recorder = new MediaRecorder(canvas.captureStream(), { mimeType: TYPES.find((type) => MediaRecorder.isTypeSupported(type)) ?? "", videoBitsPerSecond: BITS });
  const parts: Blob[] = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  const stopped = new Promise((done) => recorder.addEventListener("stop", done));
  recorder.start();
  try {
    await player.play();
    await until(() => {
      const moved = player.currentTime - last;
      last += moved;
      if (moved * way < 0) [way, turns] = [-way, turns - 1];
      return turns === 0 || player.paused || player.ended;
    });
  } finally {
    recorder.stop();
  }
  await stopped;
  player.pause();
  for (const track of recorder.stream.getTracks()) track.stop();
  return new Blob(parts, { type: recorder.mimeType });
}

/** Asks before each picture. */
function until(holds: () => boolean): Promise<void> {
  return new Promise((done) => {
    const ask = (): void => void (holds() ? done() : requestAnimationFrame(ask));
    ask();
  });
}
