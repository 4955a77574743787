// Defines <meshreel-player> as meshreel-player.js does, but takes that and its files from their gzips where the host compresses nothing. What an
// element of the page needs at once is asked for side by side.

import { importFile } from "@meshreel/player-core/net/built";

import { fileBeside } from "./beside.ts";

const here = import.meta.url;
const LARGE = ["core.wasm", "three.js"].map((name) => [name, fileBeside(here, name)] as const);
const SMALL = ["worker.js", "order.js"].map((name) => [name, new URL(name, here)] as const);
const element = fileBeside(here, "meshreel-player.js");

Object.assign(globalThis, { meshreelFiles: Object.fromEntries([...LARGE, ...SMALL].map(([name, { href }]) => [name, href])) });
if (document.querySelector('meshreel-player:not([preload="none"])')) for (const [, { href }] of LARGE) load(href);

export const { MeshreelPlayer } = await importFile<typeof import("./index.ts")>(element);

function load(href: string): void {
  const how = href.endsWith(".js") ? { rel: "modulepreload" } : { rel: "preload", as: "fetch", crossOrigin: "anonymous" };
  document.head.append(Object.assign(document.createElement("link"), { ...how, href }));
}
