// Edited files: what they show, and edits that are refused, as in Python.

import { execFileSync } from "node:child_process";

import { expect, test } from "vitest";

import { FormatError } from "../src/errors.ts";
import { editOf } from "../src/format/edit.ts";
import { Head } from "../src/format/reader.ts";
import { hasPython, PYTHON, ROOT } from "../../test/python.ts";

const SCRIPT = `
import json, sys, tempfile
import numpy as np, meshreel
from meshreel.edit.edits import cut, transform
with tempfile.TemporaryDirectory() as folder:
    cut("conformance/v1/scene.reel", folder + "/a.reel", "4:9")
    transform(folder + "/a.reel", folder + "/b.reel", 2.0, [[0, 0, 1], [0.6, 0.8, 0], [-0.8, 0.6, 0]], [1, 2, 3])
    video = meshreel.open(folder + "/b.reel")
    low, high = video.box
    origin = np.array(video.reader.header.origin)
    data = list(open(folder + "/b.reel", "rb").read())
    print(json.dumps({"data": data, "low": list(low - origin), "size": list(high - low), "rotation": video.reader.edit.rotation}))
`;

test.skipIf(!hasPython)("a cut and turned file has Python's frames and box", () => {
  const told = JSON.parse(execFileSync(PYTHON, ["-c", SCRIPT], { cwd: ROOT, maxBuffer: 1 << 26 }).toString()) as Record<"data" | "low" | "size" | "rotation", number[]>;
  const head = Head.parse(new Uint8Array(told.data));
  expect(head.frameCount).toBe(5);
  expect(head.info.rotation).toEqual(told.rotation);
  head.info.box.minimum.forEach((low, k) => expect(low).toBeCloseTo(told.low[k], 6));
  head.info.box.size.forEach((size, k) => expect(size).toBeCloseTo(told.size[k], 6));
  expect(head.chunkOfFrame(0, 0).firstFrame).toBeLessThan(0);
  expect(() => head.chunkOfFrame(5, 0)).toThrow(RangeError);
  expect(head.timestamp(4)).toBeCloseTo(4 / 25, 9);
});

test.each([
  null, [], 1, { frames: [0] }, { frames: [0, 15] }, { frames: [3, 3] }, { frames: [-1, 3] }, { frames: [0.5, 3] }, { frames: [] }, { frames: [0, 3, 5] }, { frames: [0, 3, 3, 5] }, { frames: [4, 6, 1, 3] }, { frames: "0:3" }, { rotation: [1, 1, 1, 1, 1, 1, 1, 1, 1] },
  { rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1] }, { rotation: [1, 0, 0, 0, 1, 0, 0, 0, "1"] }, { rotation: [1, 0, 0, 0, 1, 0, 0, 0] }, { rotation: { x: 1 } }, { mirror: true },
])("an edit that cannot be followed is refused: %j", (edit) => {
  expect(() => editOf({ edit }, 1, 14)).toThrow(FormatError);
  expect(editOf({ edit }, 0, 14)).toEqual({ shown: [[0, 14]], rotation: null });
});
