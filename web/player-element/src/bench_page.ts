// ?bench: plays the recording for a while and shows what this device made of it, as text and as JSON to copy.

import { Bench, formatReport } from "@meshreel/player-three/bench"; // not all of it: that is in meshreel-player.js
import type { BenchReport } from "@meshreel/player-three/bench";
import type { MeshreelPlayer } from "./index.ts";

const CALIBRATION = 60; // pictures of an idle page, which tell the display's rate

/** Plays in a loop; the report is shown below the player and given back. Where a headset is entered or left, it begins anew. */
export async function runBench(player: MeshreelPlayer, seconds: number): Promise<BenchReport> {
  const text = document.createElement("pre");
  text.setAttribute("role", "status");
  text.textContent = `Measuring for ${seconds} seconds ...`;
  document.body.append(text);
  const pageRate = await rateOfDisplay();
  if (player.readyState < 2) await new Promise((done) => player.addEventListener("canplay", done, { once: true }));
  player.loop = true;
  await player.play();
  let bench: Bench | null = null;
  while (bench === null) bench = await measured(player, seconds);
  const report = reportOf(bench, player, pageRate);
  text.textContent = `${formatReport(report)}\n\n${JSON.stringify(report)}\n`;
  return report;
}

/** What so many seconds give; null where they were not all on the page, or not all in the headset. */
async function measured(player: MeshreelPlayer, seconds: number): Promise<Bench | null> {
  const bench = new Bench();
  const stop = player.measure(bench);
  const listening = new AbortController();
  const isWhole = await new Promise<boolean>((done) => {
    const timer = setTimeout(() => done(true), 1000 * seconds);
    const moved = (): void => {
      clearTimeout(timer);
      done(false);
    };
    for (const type of ["vrstart", "vrend"]) player.addEventListener(type, moved, { signal: listening.signal });
  });
  listening.abort();
  stop();
  return isWhole ? bench : null;
}

function reportOf(bench: Bench, player: MeshreelPlayer, pageRate: number): BenchReport {
  const { gpuBytes, triangles, headsetRate } = player.statistics!;
  const page = { place: `page, ${player.clientWidth} x ${player.clientHeight}`, displayRate: pageRate };
  const headset = { place: "VR", ...(headsetRate > 0 ? { displayRate: headsetRate } : {}) };
  const place = player.presenting ? headset : page;
  return bench.report({ gpuBytes, triangles, userAgent: navigator.userAgent, gpu: nameOfGpu(), recording: player.currentSrc, ...place });
}

/** As the browser tells it; not all do. */
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
