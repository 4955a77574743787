// Draco meshes that claim what they have not got are refused before memory is taken, in Python's words. Beside tests/coding/test_mesh.py.

import { beforeAll, describe, expect, test } from "vitest";

import { hasPython, runModule } from "../../test/python.ts";
import type { Core } from "../src/wasm/core.ts";
import { FormatError } from "../src/errors.ts";
import { Form } from "../src/format/layout.gen.ts";
import { nodeCore } from "./tools.ts";

interface Made {
  readonly bombs: Readonly<Record<string, readonly [string, string]>>; // bytes and the words that refuse them
  readonly honest: Readonly<Record<string, string>>;
}

/** The faces of each frame of a group of form DRACO. */
function facesOf(core: Core, meshes: readonly Uint8Array[], step: number): number[] {
  const size = meshes.reduce((sum, { length }) => sum + 4 + length, 12);
  const payload = new Uint8Array(size);
  const view = new DataView(payload.buffer);
  payload[0] = Form.DRACO;
  view.setFloat64(2, step, true);
  view.setUint16(10, meshes.length, true);
  let at = 12;
  for (const mesh of meshes) {
    view.setUint32(at, mesh.length, true);
    payload.set(mesh, at + 4);
    at += 4 + mesh.length;
  }
  const chunk = core.open({ payload, frames: meshes.length, layers: null, previous: null, isShown: true, scale: 1, origin: [0, 0, 0] });
  try {
    return meshes.map((_, frame) => core.show(chunk, frame).faces.length / 3);
  } finally {
    core.close(chunk);
  }
}

const bytesOf = (text: string): Uint8Array => new Uint8Array(Buffer.from(text, "base64"));

describe.skipIf(!hasPython)("Draco meshes", () => {
  let core: Core;
  let made: Made;
  beforeAll(async () => {
    core = await nodeCore();
    made = JSON.parse(runModule("tests.coding.draco_bombs").toString()) as Made;
  });

  test("that claim what they have not got are refused in words", () => {
    for (const [name, [text, words]] of Object.entries(made.bombs)) {
      const refused = (): unknown => facesOf(core, [bytesOf(text)], 0.001);
      expect(refused, name).toThrow(FormatError);
      expect(refused, name).toThrow(new RegExp(words));
    }
  });

  test("that are honest are decoded behind them", () => {
    const faces = Object.values(made.honest).flatMap((text) => facesOf(core, [bytesOf(text)], 1));
    expect(faces).toEqual([2 * 4 * 4, 2 * 59 * 59, 401]);
  });

  test("of one group have what is free once", () => {
    const flat = bytesOf(made.honest["by valence"]);
    facesOf(core, [new Uint8Array(0), flat], 1);
    expect(() => facesOf(core, new Array<Uint8Array>(60).fill(flat), 1)).toThrow(/so few bytes/);
  });
});
