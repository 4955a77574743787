// Builds the player into src/meshreel/player/, or into the folder MESHREEL_PLAYER: meshreel-player.js, which defines the element, the page
// that `meshreel play` opens, the decoding worker, Draco, the worker that orders splats, and the licences of what is in them. core.wasm is put there before by
// scripts/build_wasm.py. Two builds give the same bytes.

import { copyFileSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { defineConfig } from "vite";
import type { Plugin } from "vite";

const here = fileURLToPath(new URL(".", import.meta.url));
const out = resolve(here, process.env.MESHREEL_PLAYER ?? "../src/meshreel/player");
const KEPT = new Set(["core.wasm"]);

/** Built one after the other (`vite build --mode NAME`), so that each is one file of a known name. */
export const ENTRIES: Readonly<Record<string, string>> = {
  "meshreel-player": "player-element/src/index.ts",
  worker: "player-core/src/worker_entry.ts",
  order: "player-three/src/order_worker.ts",
  page: "player-element/src/page.ts",
};

/** Before the first build takes away what an earlier one left; after it adds what is not made from modules. */
function rest(): Plugin {
  return {
    name: "meshreel-rest",
    buildStart() {
      mkdirSync(out, { recursive: true });
      for (const name of readdirSync(out)) if (!KEPT.has(name)) rmSync(join(out, name), { recursive: true });
    },
    writeBundle() {
      copyFileSync(join(here, "node_modules/draco3d/draco_decoder.wasm"), join(out, "draco.wasm"));
      for (const name of ["index.html", "page.css"]) copyFileSync(join(here, "player-element/page", name), join(out, name));
      writeFileSync(join(out, "LICENSES.txt"), licences());
    },
  };
}

/** The page takes the element from the file that is built already. */
function beside(): Plugin {
  return {
    name: "meshreel-beside",
    enforce: "pre",
    resolveId: (source) => (source === "./index.ts" ? { id: "./meshreel-player.js", external: true } : null),
  };
}

/** Draco asks for Node's modules where it runs in Node; here it never does. */
function withoutNode(): Plugin {
  return {
    name: "meshreel-without-node",
    enforce: "pre",
    resolveId: (source, importer) => (["fs", "path"].includes(source) && importer?.includes("draco3d") ? "\0none" : null),
    load: (id) => (id === "\0none" ? "export default {}" : null),
  };
}

function licences(): string {
  const text = (path: string): string => readFileSync(join(here, path), "utf8").replaceAll("\r\n", "\n").trim();
  const version = (name: string): string => (JSON.parse(text(`node_modules/${name}/package.json`)) as { version: string }).version;
  const rule = `\n\n${"-".repeat(78)}\n\n`;
  return [
    "The player of meshreel. Apache License 2.0, at the end of this file. It contains:",
    `three.js ${version("three")} (in meshreel-player.js), https://threejs.org\n\n${text("node_modules/three/LICENSE")}`,
    `draco3d ${version("draco3d")} (in worker.js; draco.wasm), https://github.com/google/draco\n\n` +
      "Copyright The Draco Authors. Apache License 2.0, at the end of this file.",
    "Eigen (in core.wasm), https://eigen.tuxfamily.org\n\nMozilla Public License 2.0, https://mozilla.org/MPL/2.0/; its source is unchanged.",
    text("../LICENSE"),
  ].join(rule) + "\n";
}

export default defineConfig(({ mode }) => {
  const name = mode in ENTRIES ? mode : "meshreel-player";
  return {
    root: here,
    base: "./",
    publicDir: false,
    plugins: name === "meshreel-player" ? [rest()] : name === "page" ? [beside()] : [withoutNode()],
    build: {
      outDir: out,
      emptyOutDir: false,
      target: "es2022",
      modulePreload: false,
      sourcemap: false,
      chunkSizeWarningLimit: 2000,
      rolldownOptions: {
        input: join(here, ENTRIES[name]!),
        preserveEntrySignatures: "strict",
        output: { entryFileNames: `${name}.js`, chunkFileNames: `${name}-[name].js` },
      },
    },
  };
});
