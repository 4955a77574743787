// The first view of a file, as in Python.

import { execFileSync } from "node:child_process";

import { expect, test } from "vitest";

import { Head } from "../src/format/reader.ts";
import { viewOf } from "../src/format/view.ts";
import { hasPython, PYTHON, ROOT } from "../../test/python.ts";

const SCRIPT = `
import json, tempfile
import numpy as np, meshreel
from meshreel.edit.edits import tag, transform
with tempfile.TemporaryDirectory() as folder:
    tag("conformance/v1/scene.reel", folder + "/a.reel", view=[0.1, 1.6, 3, 0, 1, 0, 30])
    transform(folder + "/a.reel", folder + "/b.reel", 2.0, [[0, 0, 1], [0.6, 0.8, 0], [-0.8, 0.6, 0]], [1, 2, 3])
    video = meshreel.open(folder + "/b.reel")
    origin, view = np.array(video.reader.header.origin), video.view
    data = list(open(folder + "/b.reel", "rb").read())
    print(json.dumps({"data": data, "position": list(view.position - origin), "target": list(view.target - origin), "fov": [view.fov]}))
`;

test.skipIf(!hasPython)("a tagged and turned file has Python's view", () => {
  const told = JSON.parse(execFileSync(PYTHON, ["-c", SCRIPT], { cwd: ROOT, maxBuffer: 1 << 26 }).toString()) as Record<"data" | "position" | "target" | "fov", number[]>;
  const { view } = Head.parse(new Uint8Array(told.data)).info;
  view!.position.forEach((value, k) => expect(value).toBeCloseTo(told.position[k], 6));
  view!.target.forEach((value, k) => expect(value).toBeCloseTo(told.target[k], 6));
  expect([view!.fov]).toEqual(told.fov);
});

const STILL = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const GOOD = { position: [0, 1, 3], target: [0, 1, 0], fov: 45 };

test("a view is scaled and turned as the box is", () => {
  expect(viewOf({ view: GOOD }, 2, STILL)).toEqual({ position: [0, 2, 6], target: [0, 2, 0], fov: 45 });
  expect(viewOf({ view: { ...GOOD, later: 1 } }, 1, [0, 0, 1, 1, 0, 0, 0, 1, 0])?.position).toEqual([3, 0, 1]);
});

test.each([
  "front", null, [], { ...GOOD, fov: 0 }, { ...GOOD, fov: 180 }, { ...GOOD, fov: "45" }, { ...GOOD, target: GOOD.position }, { ...GOOD, position: [0, 1] },
  { ...GOOD, position: [0, 1, 1e16] }, { ...GOOD, position: [0, 1, "3"] }, { ...GOOD, target: { x: 1 } }, { position: [0, 1, 3], target: [0, 1, 0] },
])("what is no view is passed over: %j", (view) => {
  expect(viewOf({ view }, 1, STILL)).toBeNull();
  expect(viewOf({}, 1, STILL)).toBeNull();
});
