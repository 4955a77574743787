// Builds the player into src/meshreel/player/, or into the folder MESHREEL_PLAYER: meshreel-player.js, which defines the element, load.js, which loads
// it with fewer bytes, three.js, which draws, the page that `meshreel play` opens, study.js, which that loads for studies alone, the decoding worker, the
// worker that orders splats, the licences of what is in them, each in Brotli, and what is large as a gzip. core.wasm is put there before by
// scripts/build_wasm.py. Two builds give the same bytes.

import { mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { extname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, constants } from "node:zlib";
import { gzipSync } from "three/addons/libs/fflate.module.js";
import { defineConfig } from "vite";
import type { Plugin } from "vite";

const here = fileURLToPath(new URL(".", import.meta.url));
const out = resolve(here, process.env.MESHREEL_PLAYER ?? "../src/meshreel/player");
const KEPT = new Set(["core.wasm"]);
const LARGE = new Set(["core.wasm", "three.js", "meshreel-player.js"]);

/** Built one after the other (`vite build --mode NAME`), so that each is one file of a known name. */
export const ENTRIES: Readonly<Record<string, string>> = {
  "meshreel-player": "player-element/src/index.ts",
  three: "player-element/src/stage_three.ts",
  worker: "player-core/src/worker_entry.ts",
  order: "player-three/src/order_worker.ts",
  load: "player-element/src/load.ts",
  study: "player-element/src/study.ts",
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
      const [page, styles] = ["index.html", "page.css"].map((name) => readFileSync(join(here, "player-element/page", name), "utf8"));
      writeFileSync(join(out, "index.html"), inlined(page!, styles!.trim()));
      writeFileSync(join(out, "page.css"), styles!);
      writeFileSync(join(out, "LICENSES.txt"), licences());
    },
  };
}

/** A page with its styles within it, so that it is seen at once; the link stays, for servers whose policy refuses those. */
function inlined(page: string, styles: string): string {
  const link = '<link rel="stylesheet" href="page.css">';
  return page.replace(link, `<style>${styles}</style>`).replace("</body>", `${link}\n</body>`);
}

/** The page takes the element, and studies, by the files that are built already. */
function beside(): Plugin {
  return {
    name: "meshreel-beside",
    enforce: "pre",
    resolveId: (source) => (source === "./load.ts" || source === "./study.ts" ? { id: source.replace(".ts", ".js"), external: true } : null),
  };
}

/** Behind the last build: what web servers send to browsers that take it, and what the player unpacks itself where they send nothing compressed. */
function compressed(): Plugin {
  return {
    name: "meshreel-compressed",
    writeBundle() {
      for (const name of readdirSync(out)) {
        if (![".js", ".wasm"].includes(extname(name))) continue;
        const bytes = readFileSync(join(out, name));
        const params = { [constants.BROTLI_PARAM_QUALITY]: constants.BROTLI_MAX_QUALITY, [constants.BROTLI_PARAM_SIZE_HINT]: bytes.length };
        writeFileSync(join(out, `${name}.br`), brotliCompressSync(bytes, { params }));
        if (LARGE.has(name)) writeFileSync(join(out, `${name}.gz`), gzipSync(bytes, { level: 9, mem: 12, mtime: 0 })); // zlib's bytes depend on the machine
      }
    },
  };
}

/** three.js without the shaders of materials that are not used: a fifth of its bytes. A headset's hands have MeshBasicMaterial. */
function withoutShaders(): Plugin {
  const text = /^(?:var|const) ([\w$]+) = ("(?:[^"\\]|\\.)*");$/gm;
  return {
    name: "meshreel-without-shaders",
    transform(code, id) {
      if (!id.endsWith("three/build/three.module.js")) return null;
      const texts = new Map([...code.matchAll(text)].map(([, name, literal]) => [name!, literal!]));
      const nameOf = (chunk: string): string => new RegExp(`^\\s*${chunk}(?:: ([\\w$]+))?,?$`, "m").exec(code)?.[1] ?? chunk;
      const kept = new Set(["meshbasic_vert", "meshbasic_frag"].map(nameOf));
      for (const name of kept) for (const [, chunk] of (texts.get(name) ?? "").matchAll(/#include <(\w+)>/g)) kept.add(nameOf(chunk!));
      if (kept.size < 20) this.error("three.js has its shaders elsewhere: look at withoutShaders");
      return code.replaceAll(text, (whole, name: string, literal: string) => (kept.has(name) || !/gl_|#include|#if/.test(literal) ? whole : `const ${name} = "";`));
    },
  };
}

function licences(): string {
  const text = (path: string): string => readFileSync(join(here, path), "utf8").replaceAll("\r\n", "\n").trim();
  const version = (name: string): string => (JSON.parse(text(`node_modules/${name}/package.json`)) as { version: string }).version;
  const rule = `\n\n${"-".repeat(78)}\n\n`;
  return [
    "The player of meshreel. Apache License 2.0, at the end of this file. It contains:",
    `three.js ${version("three")} (in three.js), https://threejs.org\n\n${text("node_modules/three/LICENSE")}`,
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
    plugins: name === "meshreel-player" ? [rest()] : name === "three" ? [withoutShaders()] : name === "page" ? [beside(), compressed()] : [],
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
