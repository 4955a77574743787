// Draco meshes that claim what they have not got are refused before Draco sees them, in Python's words. Beside tests/coding/test_mesh.py.

import { beforeAll, describe, expect, test, vi } from "vitest";

import { hasPython, runModule } from "../../test/python.ts";
import type { Tools } from "../src/decode/group.ts";
import { decodeMesh } from "../src/decode/mesh.ts";
import { checkClaims } from "../src/wasm/draco.ts";
import { FormatError } from "../src/errors.ts";
import { nodeTools } from "./tools.ts";

interface Made {
  readonly bombs: Readonly<Record<string, readonly [string, string]>>; // bytes and the words that refuse them
  readonly honest: Readonly<Record<string, string>>;
}

const bytesOf = (text: string): Uint8Array => new Uint8Array(Buffer.from(text, "base64"));

describe.skipIf(!hasPython)("Draco meshes", () => {
  let tools: Tools;
  let made: Made;
  beforeAll(async () => {
    tools = await nodeTools();
    made = JSON.parse(runModule("tests.coding.draco_bombs").toString()) as Made;
  });

  test("that claim what they have not got are refused in words, and Draco does not see them", () => {
    const seen = vi.spyOn(tools.draco, "Decoder");
    for (const [name, [text, words]] of Object.entries(made.bombs)) {
      const refused = (): unknown => decodeMesh(tools.core, tools.draco, bytesOf(text), 0.001);
      expect(refused, name).toThrow(FormatError);
      expect(refused, name).toThrow(new RegExp(words));
    }
    expect(seen).not.toHaveBeenCalled();
    seen.mockRestore();
  });

  test("that are honest are decoded behind them", () => {
    const faces = Object.values(made.honest).map((text) => decodeMesh(tools.core, tools.draco, bytesOf(text), 1).faces.length / 3);
    expect(faces).toEqual([2 * 4 * 4, 2 * 59 * 59, 401]);
  });

  test("of one group have what is free once", () => {
    const flat = bytesOf(made.honest["by valence"]);
    checkClaims(tools.core, [new Uint8Array(0), flat]);
    expect(() => checkClaims(tools.core, new Array<Uint8Array>(60).fill(flat))).toThrow(/so few bytes/);
  });
});
