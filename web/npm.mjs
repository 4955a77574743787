// Makes the packages for npm: `node npm.mjs FOLDER` writes FOLDER/meshreel-player and FOLDER/meshreel-three, ready for `npm pack` or `npm publish`.
// The element and its files are those of src/meshreel/player; built here is only what draws into a scene that a page has already.

import { execFileSync } from "node:child_process";
import { copyFileSync, cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join, posix, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "vite";

const WEB = fileURLToPath(new URL(".", import.meta.url));
const ROOT = dirname(resolve(WEB));
const PLAYER = join(ROOT, "src/meshreel/player");
const BUILT = ["meshreel-player.js", "three.js", "worker.js", "order.js", "core.wasm", "LICENSES.txt"];
const out = resolve(process.argv[2] ?? "");
if (process.argv.length !== 3) throw new Error("usage: node npm.mjs FOLDER");

/** Every declaration that a module's reaches, under `types/`; names of our own packages become paths. */
function declare(declared, entry, folder) {
  const reached = new Set([entry]);
  for (const file of reached) {
    const pathOf = (name) => {
      const [, own, rest] = /^@meshreel\/([^/]+)\/?(.*)$/.exec(name) ?? [];
      if (own === undefined && !name.startsWith(".")) return name; // of another package
      const target = own === undefined ? posix.join(posix.dirname(file), name).replace(/\.ts$/, "") : `${own}/src/${rest || "index"}`;
      reached.add(`${target}.d.ts`);
      const path = posix.relative(posix.dirname(file), `${target}.js`);
      return path.startsWith(".") ? path : `./${path}`;
    };
    const text = readFileSync(join(declared, file), "utf8").replaceAll(/(\bfrom |^import |\bimport\()"([^"]+)"/gm, (_, before, name) => `${before}"${pathOf(name)}"`);
    const to = join(folder, "types", file);
    mkdirSync(dirname(to), { recursive: true });
    writeFileSync(to, text);
  }
}

/** What npm shows of a package, and where its sources are: a workflow knows the repository, a clone does not. */
function describe(name, folder) {
  const written = JSON.parse(readFileSync(join(WEB, name, "package.json"), "utf8"));
  const version = /^__version__ = "(.+)"$/m.exec(readFileSync(join(ROOT, "src/meshreel/__init__.py"), "utf8"))[1];
  if (written.version !== version) throw new Error(`web/${name}/package.json has version ${written.version}, src/meshreel/__init__.py ${version}`);
  const repository = process.env.GITHUB_REPOSITORY; // owner/name
  const url = `${process.env.GITHUB_SERVER_URL ?? "https://github.com"}/${repository}`;
  const links = { homepage: `${url}#readme`, bugs: `${url}/issues`, repository: { type: "git", url: `git+${url}.git`, directory: `web/${name}` } };
  writeFileSync(join(folder, "package.json"), `${JSON.stringify({ ...written, ...(repository ? links : {}) }, null, 2)}\n`);
  for (const file of ["LICENSE", "NOTICE"]) copyFileSync(join(ROOT, file), join(folder, file));
}

const declared = mkdtempSync(join(tmpdir(), "meshreel-types-"));
try {
  const tsc = join(WEB, "node_modules/typescript/bin/tsc");
  execFileSync(process.execPath, [tsc, "-p", join(WEB, "tsconfig.types.json"), "--outDir", declared], { stdio: "inherit" });
  for (const [name, entry] of [["meshreel-player", "player-element/src/element.d.ts"], ["meshreel-three", "meshreel-three/src/index.d.ts"]]) {
    const folder = join(out, name);
    rmSync(folder, { recursive: true, force: true });
    cpSync(join(WEB, name), folder, { recursive: true, filter: (path) => !/^(src|test)\b/.test(relative(join(WEB, name), path)) });
    declare(declared, entry, folder);
    describe(name, folder);
  }
} finally {
  rmSync(declared, { recursive: true, force: true });
}
for (const name of BUILT) copyFileSync(join(PLAYER, name), join(out, "meshreel-player", name));
await build({
  configFile: false,
  root: WEB,
  logLevel: "error",
  publicDir: false,
  build: {
    outDir: join(out, "meshreel-three"),
    emptyOutDir: false,
    target: "es2022",
    lib: { entry: join(WEB, "meshreel-three/src/index.ts"), formats: ["es"], fileName: () => "index.js" },
    rolldownOptions: { external: ["three", "meshreel-player/files"] },
  },
});
