// ?bench: plays the recording for a while and shows what this device made of it, as text and as JSON to copy.
// ?bench=5 takes 5 seconds.

import { Bench, formatReport } from "@meshreel/player-three/bench"; // not all of it: that is in meshreel-player.js
import type { BenchReport } from "@meshreel/player-three/bench";
import type { MeshreelPlayer } from "./index.ts";

const SECONDS = 20;
const CALIBRATION = 60; // pictures of an idle page, which tell the display's rate

/** Plays in a loop, in a headset where one is entered meanwhile; the report is shown below the player and given back. */
export async function runBench(player: MeshreelPlayer, seconds = SECONDS): Promise<BenchReport> {
  const text = document.createElement("pre");
  text.setAttribute("role", "status");
  text.textContent = `Measuring for ${seconds} seconds ...`;
  document.body.append(text);
  const displayRate = await rateOfDisplay();
  if (player.readyState < 2) await new Promise((done) => player.addEventListener("canplay", done, { once: true }));
  player.loop = true;
  await player.play();
  const bench = new Bench({ displayRate });
  const stop = player.measure(bench);
  await new Promise((done) => setTimeout(done, 1000 * seconds));
  stop();
  const { gpuBytes, triangles } = player.statistics!;
  const place = player.presenting ? "VR" : `page, ${player.clientWidth} x ${player.clientHeight}`;
  const report = bench.report({ gpuBytes, triangles, userAgent: navigator.userAgent, place, recording: player.currentSrc });
  text.textContent = `${formatReport(report)}\n\n${JSON.stringify(report)}\n`;
  return report;
}

/** Pictures a second of a page that does nothing, Hz. */
async function rateOfDisplay(): Promise<number> {
  const picture = (): Promise<number> => new Promise((done) => requestAnimationFrame(done));
  const times: number[] = [];
  for (let count = 0; count <= CALIBRATION; count++) times.push(await picture());
  const intervals = times.slice(1).map((time, k) => time - times[k]!).sort((a, b) => a - b);
  return 1000 / intervals[intervals.length >> 1]!;
}
