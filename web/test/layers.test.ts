// Packages import only downwards, and player-core runs where there is no page: what import-linter is to Python.

import { readFileSync, readdirSync } from "node:fs";
import { dirname, join, relative, resolve, sep } from "node:path";
import { fileURLToPath } from "node:url";
import { describe, expect, test } from "vitest";

const WEB = fileURLToPath(new URL("../", import.meta.url));

/** What each package may import besides its own files. */
const ALLOWED: Readonly<Record<string, readonly RegExp[]>> = {
  "player-core": [],
  "player-three": [/^three$/, /^@meshreel\/player-core\/types$/],
  xr: [/^three$/, /^@meshreel\/player-core\/types$/],
  "player-element": [/^three(\/|$)/, /^@meshreel\/(player-core|player-three|xr)(\/|$)/],
  "meshreel-three": [/^three$/, /^meshreel-player\/files$/, /^@meshreel\/(player-core|player-three)$/],
};

/** The rooms of player-core and what each may import besides its own files; GROUND and what stands loose above the rooms are rooms, too. */
const ROOMS: Readonly<Record<string, readonly string[]>> = {
  door: ["player", "decode", "net", "time", "ground"], // the entries: of the page, and of a worker
  player: ["time", "net", "format", "ground"], // the player and a session of it
  time: ["net", "format", "ground"], // which chunk is needed when, and what is shown
  net: ["format", "ground"], // ranges of a file
  decode: ["wasm", "format", "ground"], // chunks to meshes: the workers' half
  wasm: ["format", "ground"], // calls of the compiled core
  format: ["ground"], // the records of a file
  ground: [],
};
const LOOSE: Readonly<Record<string, string>> = {
  index: "door", worker_entry: "door", player: "player", players: "player", session: "player",
  events: "ground", protocol: "ground", bytes: "ground", errors: "ground", types: "ground",
};

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

function roomOf(name: string): string {
  const room = name.includes("/") ? name.slice(0, name.indexOf("/")) : LOOSE[name];
  expect(Object.keys(ROOMS), `${name} is in no room: add it to this test`).toContain(room);
  return room;
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

  test("imports only what its rooms may", () => {
    for (const module of modules) {
      const room = roomOf(module.name);
      for (const target of targetsOf(module)) expect([room, ...ROOMS[room]], `${module.name} imports ${target}`).toContain(roomOf(target));
    }
  });

  test("has no rooms that import each other in a circle", () => {
    const below = Object.keys(ROOMS);
    for (const [k, room] of below.entries()) for (const other of ROOMS[room]) expect(below.indexOf(other), `${room} imports ${other}`).toBeGreaterThan(k);
  });

  test("has no decoder in what a page loads: that is the workers'", () => {
    const reached = ["index"];
    for (const name of reached) {
      const module = modules.find((one) => one.name === name)!;
      for (const target of targetsOf(module)) if (!reached.includes(target)) reached.push(target);
    }
    expect(reached).toContain("session");
    expect(reached.filter((name) => ["decode", "wasm"].includes(roomOf(name)))).toEqual([]);
  });
});
