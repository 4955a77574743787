// ?bench: plays the recording for a while, seeks in it, and shows what this device made of it, as text and as JSON to copy.

import { Bench, formatReport } from "@meshreel/player-three/bench"; // not all of it: that is in meshreel-player.js
import type { BenchReport } from "@meshreel/player-three/bench";
import type { MeshreelPlayer } from "./index.ts";

const CALIBRATION = 60; // pictures of an idle page, from which the display's rate follows
const SEEKS = 12;
const APART = (Math.sqrt(5) - 1) / 2; // of the recording from seek to seek, wrapped: far from all places before

/**
 * Plays in a loop, then seeks; the report is shown below the player and given back. To be called before the recording is opened, so that
 * what is decoded at once counts too. Where a headset is entered or left, counting starts again.
 */
export async function runBench(player: MeshreelPlayer, seconds: number): Promise<BenchReport> {
  const text = document.createElement("pre");
  text.setAttribute("role", "status");
  text.textContent = `Measuring for ${seconds} seconds ...`;
  document.body.append(text);
  await told(player, "loadstart");
  const bench = new Bench();
  const stop = player.measure(bench);
  const canPlay = told(player, "canplay");
  const pageRate = await rateOfDisplay();
  await canPlay;
  player.loop = true;
  await player.play();
  while (!(await passed(player, seconds, bench)));
  stop();
  await seek(player, bench);
  const report = reportOf(bench, player, pageRate);
  text.textContent = `${formatReport(report)}\n\n${JSON.stringify(report)}\n`;
  return report;
}

function told(player: MeshreelPlayer, ...types: readonly string[]): Promise<void> {
  const listening = new AbortController();
  return new Promise((done) => {
    const tell = (): void => {
      listening.abort();
      done();
    };
    for (const type of types) player.addEventListener(type, tell, { signal: listening.signal });
  });
}

/** Collects pictures for a number of seconds; false where these were not all on the page, or not all in the headset. */
async function passed(player: MeshreelPlayer, seconds: number, bench: Bench): Promise<boolean> {
  bench.restart();
  const timer = new Promise<boolean>((done) => setTimeout(() => done(true), 1000 * seconds));
  return Promise.race([timer, told(player, "vrstart", "vrend").then(() => false)]);
}

/** Goes to places all over the recording, the same ones each time, and plays on. An error ends it. */
async function seek(player: MeshreelPlayer, bench: Bench): Promise<void> {
  player.pause();
  for (let count = 1; count <= SEEKS && player.error === null; count++) {
    const sought = told(player, "seeked", "error");
    const start = performance.now();
    player.currentTime = player.duration * ((count * APART) % 1);
    await sought;
    if (player.error === null) bench.sought(performance.now() - start);
  }
  if (player.error === null) await player.play();
}

function reportOf(bench: Bench, player: MeshreelPlayer, pageRate: number): BenchReport {
  const { gpuBytes, triangles, headsetRate } = player.statistics!;
  const page = { place: `page, ${player.clientWidth} x ${player.clientHeight}`, displayRate: pageRate };
  const headset = { place: "VR", ...(headsetRate > 0 ? { displayRate: headsetRate } : {}) };
  const place = player.presenting ? headset : page;
  return bench.report({ gpuBytes, triangles, userAgent: navigator.userAgent, gpu: nameOfGpu(), recording: player.currentSrc, ...place });
}

/** As the browser reports it; not all browsers do. */
function nameOfGpu(): string {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? String(gl!.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "-";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

/** Pictures a second of a page that does nothing, Hz. */
async function rateOfDisplay(): Promise<number> {
  const picture = (): Promise<number> => new Promise((done) => requestAnimationFrame(done));
  const times: number[] = [];
  for (let count = 0; count <= CALIBRATION; count++) times.push(await picture());
  const intervals = times.slice(1).map((time, k) => time - times[k]!).sort((a, b) => a - b);
  return 1000 / intervals[intervals.length >> 1]!;
}
