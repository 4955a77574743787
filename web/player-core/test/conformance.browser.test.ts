// In Chromium the golden files decode to the same bits as in Python and in Node.

import { readFileSync, readdirSync } from "node:fs";
import { fileURLToPath } from "node:url";

import { afterAll, beforeAll, expect, test } from "vitest";

import { describeInBrowser, openPage } from "../../test/browser.ts";
import type { OpenPage } from "../../test/browser.ts";
import { ROOT, coreWasm } from "./tools.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".json")).map((name) => name.slice(0, -5));

describeInBrowser("golden files in Chromium", () => {
  let opened: OpenPage;
  beforeAll(async () => {
    opened = await openPage(fileURLToPath(new URL("conformance_page.ts", import.meta.url)));
    await opened.page.waitForFunction("globalThis.decodeAll");
  });
  afterAll(() => opened?.close());

  test.each(NAMES)("%s", async (name) => {
    const golden = JSON.parse(readFileSync(`${FOLDER}/${name}.json`, "utf8"));
    const file = [...readFileSync(`${FOLDER}/${name}.reel`)];
    const wasm = [[...new Uint8Array(coreWasm())]];
    for (const [layers, key] of [[null, "frames"], [1, "frames_with_one_component"]] as const) {
      if (golden[key] === undefined) continue;
      const call = `decodeAll(${[...wasm, file, layers].map((value) => JSON.stringify(value)).join(", ")})`;
      const wanted = golden[key].map(({ first_vertices: _, ...record }: Record<string, unknown>) => record);
      expect(await opened.page.evaluate(call)).toEqual(wanted);
    }
    expect(opened.errors).toEqual([]);
  });
});
