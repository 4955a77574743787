// The page that plays one recording over the whole window: the address says which, and how.

import { runBench } from "./bench_page.ts";
import { MeshreelPlayer } from "./index.ts";
import { recordingName } from "./format.ts";
import { readParameters } from "./parameters.ts";

function start(): void {
  const player = document.querySelector("meshreel-player");
  if (!(player instanceof MeshreelPlayer)) return;
  const { attributes, time, bench } = readParameters(location.search);
  for (const [name, value] of attributes) {
    if (value === null) player.removeAttribute(name);
    else player.setAttribute(name, value);
  }
  if (time > 0) player.currentTime = time;
  if (bench !== null) void runBench(player, bench);
  if (player.src) document.title = `${recordingName(player.src)} · meshreel`;
}

start();
