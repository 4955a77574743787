// The compiled core exports what the player calls, and nothing else.

import { readFileSync, readdirSync } from "node:fs";

import { expect, test } from "vitest";

import { ROOT, coreWasm } from "./tools.ts";

const CALLS = `${ROOT}/web/player-core/src/wasm`;

test("every function that is called is exported, and every one that is exported is called", async () => {
  const sources = readdirSync(CALLS).map((name) => readFileSync(`${CALLS}/${name}`, "utf8"));
  const called = sources.flatMap((text) => [...text.matchAll(/\bcall\("(\w+)"/g)].map((match) => match[1]));
  const listed = readFileSync(`${ROOT}/core/wasm/exports.txt`, "utf8").split(/\s+/).filter(Boolean);
  expect(new Set(listed)).toEqual(new Set(called));
  expect(new Set(listed).size).toBe(listed.length);
  const built = WebAssembly.Module.exports(await WebAssembly.compile(coreWasm())).filter(({ kind }) => kind === "function");
  expect(new Set(built.map(({ name }) => name))).toEqual(new Set([...listed, "_initialize"]));
});
