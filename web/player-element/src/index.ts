// The package: importing it defines <meshreel-player>.

import { fileBeside } from "./beside.ts";
import { MeshreelPlayer } from "./element.ts";
import { RealEngine } from "./engine.ts";

export { MeshreelPlayer };

// Files beside the built module, or where a page that has them in itself says (`meshreelFiles`: addresses by name). The addresses are made
// in two steps because the bundler takes what it sees for modules of its own.
const elsewhere = (globalThis as { meshreelFiles?: Readonly<Record<string, string>> }).meshreelFiles;
const beside = (name: string): URL => new URL(elsewhere?.[name] ?? name, import.meta.url);

if (globalThis.customElements && !customElements.get("meshreel-player")) {
  MeshreelPlayer.engine = new RealEngine({
    worker: beside("worker.js"), core: elsewhere ? beside("core.wasm") : fileBeside(import.meta.url, "core.wasm"), order: beside("order.js"), three: beside("three.js"),
  });
  customElements.define("meshreel-player", MeshreelPlayer);
}
