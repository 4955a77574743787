// An address that says what is seen: time, camera, shading and section stand behind its #.

import type { MeshreelPlayer } from "./element.ts";

const QUIET = 400; // ms without a change before the address follows: browsers bear no more than some a second

/** Text behind the # of an address for the current view; "" for the view in which a recording opens. */
export function stateOf(player: MeshreelPlayer): string {
  const state = new URLSearchParams();
  if (player.currentTime > 0) state.set("t", player.currentTime.toFixed(3));
  for (const name of ["mode", "section", "up"]) {
    const value = player.getAttribute(name);
    if (value !== null) state.set(name, value);
  }
  if (player.cameraMoved) state.set("camera", player.camera);
  return state.toString().replaceAll("%2C", ",");
}

/** The page's address with what is seen now. */
export function linkOf(player: MeshreelPlayer): string {
  const address = new URL(location.href);
  address.hash = stateOf(player);
  return address.href;
}

/** Has the page's address follow what is seen while it stands still, and what is seen follow an address that is typed: `apply` reads it. */
export function followAddress(player: MeshreelPlayer, apply: () => void): void {
  let timer = 0;
  let known = location.href; // as last written, or applied
  const write = (): void => {
    if (location.href !== known) return; // another one has been typed, and its event is on its way
    if (player.paused && !player.seeking && player.info && linkOf(player) !== location.href) history.replaceState(history.state, "", linkOf(player));
    known = location.href;
  };
  const later = (): void => {
    clearTimeout(timer);
    timer = window.setTimeout(write, QUIET);
  };
  for (const type of ["pause", "seeked", "camerachange", "ended"]) player.addEventListener(type, later);
  new MutationObserver(later).observe(player, { attributeFilter: ["mode", "section", "up"] });
  // replaceState brings none
  addEventListener("hashchange", () => {
    known = location.href;
    apply();
  });
}
