// The page that plays one recording over the whole window, or runs a study: the address says which, and how.

import { followAddress } from "./address.ts";
import { runBench } from "./bench_page.ts";
import { recordingName } from "./format.ts";
import type { MeshreelPlayer } from "./index.ts";
import { readParameters } from "./parameters.ts";

async function start(): Promise<void> {
  const player = document.querySelector<MeshreelPlayer>("meshreel-player");
  if (player === null) return;
  const { attributes, time, bench, study, participant } = readParameters(location.search);
  if (study !== "") {
    player.removeAttribute("src");
    const [{ MeshreelPlayer: element }, { runStudy }] = await Promise.all([import("./load.ts"), import("./study.ts")]);
    await element.engine.load();
    return runStudy(element, study, participant);
  }
  const opened = player.getAttribute("src"); // of a server's page
  const follow = (): void => {
    const typed = readParameters(`?${location.hash.slice(1)}`);
    apply(player, typed.attributes, typed.time);
  };
  if (bench === null) {
    apply(player, attributes, time); // before it is defined, when it opens what it finds
    follow(); // it goes before what stands in front of it
  } else player.removeAttribute("src"); // it measures from the opening on
  const loaded = await import("./load.ts");
  if (bench === null) {
    followAddress(player, follow);
    player.share = true;
  } else {
    await loaded.MeshreelPlayer.engine.load();
    if (opened !== null) player.setAttribute("src", opened);
    apply(player, attributes, time);
    void runBench(player, bench);
  }
  takeFocus(player);
  if (player.src) document.title = `${recordingName(player.src)} · meshreel`;
}

function apply(player: MeshreelPlayer, attributes: ReadonlyMap<string, string | null>, time: number): void {
  for (const [name, value] of attributes) {
    if (value === null) player.removeAttribute(name);
    else player.setAttribute(name, value);
  }
  if (time > 0) player.currentTime = time;
}

/** So that keys act without a click, which would play. A frame of another page leaves the focus where that has it. */
function takeFocus(player: MeshreelPlayer): void {
  const isFree = document.activeElement === null || document.activeElement === document.body;
  if (window.parent === window && isFree) player.focus({ preventScroll: true, focusVisible: false });
}

void start();
