// Packages import only downwards, and player-core runs where there is no page: what import-linter is to Python.

import { readFileSync, readdirSync } from "node:fs";
import { dirname, join, relative, resolve, sep } from "node:path";
import { fileURLToPath } from "node:url";
import { describe, expect, test } from "vitest";

const WEB = fileURLToPath(new URL("../", import.meta.url));

/** What each package may import besides its own files. */
const ALLOWED: Readonly<Record<string, readonly RegExp[]>> = {
  "player-core": [/^draco3d(\/|$)/],
  "player-three": [/^three$/, /^@meshreel\/player-core\/types$/],
  xr: [/^three$/, /^@meshreel\/player-core\/types$/],
  "player-element": [/^three(\/|$)/, /^@meshreel\/(player-core|player-three|xr)(\/|$)/],
};

/** Within player-core, from the top down: a file imports those of its own layer and of those below. */
const CORE: readonly RegExp[] = [
  /^(index|worker_entry)$/,
  /^(player|session|decoding|picture|adaptive|scheduler|fetcher|pool|worker|chunk_decoder|decoder|pack|tools|clock|events|links|opening|http_.*|whole_body|source|bandwidth|protocol|reader|checks)$/,
  /^coding\//,
  /^wasm\//,
  /^(records|layout\.gen|mesh|bytes|crc|errors|types)$/,
];

/** The workers' half. */
const DECODER = /^(coding|wasm)\/|^(worker|chunk_decoder|decoder|pack|tools)$/;

const PAGE = /\b(document|window|HTMLElement|customElements|requestAnimationFrame|localStorage|WebGL2?RenderingContext)\b/;

interface Module {
  readonly name: string; // from its package's src/, without its ending
  readonly path: string;
  readonly code: string; // without comments
  readonly imports: readonly string[];
}

function modulesOf(name: string): Module[] {
  const source = join(WEB, name, "src");
  const files = readdirSync(source, { recursive: true, encoding: "utf8" }).filter((file) => file.endsWith(".ts") && !file.endsWith(".d.ts"));
  return files.map((file) => {
    const path = join(source, file);
    const code = readFileSync(path, "utf8").replaceAll(/\/\*[\s\S]*?\*\/|^\s*\/\/.*$|(?<=[;{},]) \/\/.*$/gm, "");
    const imports = [...code.matchAll(/(?:\bfrom|^import)\s+"([^"]+)"/gm)].map((match) => match[1]);
    return { name: file.slice(0, -3).split(sep).join("/"), path, code, imports };
  });
}

function layerOf(name: string): number {
  const layer = CORE.findIndex((pattern) => pattern.test(name));
  expect(layer, `${name} is in no layer: add it to this test`).toBeGreaterThanOrEqual(0);
  return layer;
}

describe.each(Object.keys(ALLOWED))("%s", (name) => {
  const modules = modulesOf(name);

  test("imports its own files and what lies below it, and nothing else", () => {
    expect(modules.length).toBeGreaterThan(1);
    for (const { path, imports } of modules) {
      for (const other of imports) {
        const isOwn = other.startsWith(".") && !relative(join(WEB, name, "src"), resolve(dirname(path), other)).startsWith("..");
        expect(isOwn || ALLOWED[name].some((pattern) => pattern.test(other)), `${path} imports ${other}`).toBe(true);
      }
    }
  });
});

describe("player-core", () => {
  const modules = modulesOf("player-core");

  test("knows no page", () => {
    for (const { path, code } of modules) expect(PAGE.exec(code)?.[0], path).toBeUndefined();
  });

  const targetsOf = ({ name, imports }: Module): string[] =>
    imports.filter((one) => one.startsWith(".")).map((one) => join(dirname(name), one).split(sep).join("/").replace(/\.ts$/, ""));

  test("imports only downwards", () => {
    for (const module of modules) {
      for (const target of targetsOf(module)) expect(layerOf(module.name), `${module.name} imports ${target}`).toBeLessThanOrEqual(layerOf(target));
    }
  });

  test("has no decoder in what a page loads: that is the workers'", () => {
    const reached = ["index"];
    for (const name of reached) {
      const module = modules.find((one) => one.name === name)!;
      for (const target of targetsOf(module)) if (!reached.includes(target)) reached.push(target);
    }
    expect(reached).toContain("session");
    expect(reached.filter((name) => DECODER.test(name))).toEqual([]);
  });
});
