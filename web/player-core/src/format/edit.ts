// Edits of a file: which of its coded frames are shown, and how they are turned. Beside format/edit.py.

import { FormatError } from "../errors.ts";
import { EDITED } from "./layout.gen.ts";

export interface Edit {
  readonly first: number; // coded frames `first` to `end` - 1 are shown
  readonly end: number;
  readonly rotation: readonly number[] | null; // about the header's origin, nine numbers, row by row
}

const CLOSE = 1e-6; // to a rotation

/** The edit of a file of so many coded frames. FormatError for one that this player cannot follow. */
export function editOf(metadata: Readonly<Record<string, unknown>>, flags: number, frames: number): Edit {
  const item = flags & EDITED ? metadata.edit : {};
  if (typeof item !== "object" || item === null || Array.isArray(item)) throw new FormatError("Header.metadata: no edit");
  const { frames: shown = [0, frames], rotation = [], ...others } = item as Record<string, unknown>;
  if (Object.keys(others).length > 0) throw new FormatError("Header.metadata: an edit that this player does not know, update it", "newer");
  if (!Array.isArray(shown) || shown.length !== 2 || !shown.every(Number.isInteger)) throw new FormatError("Header.metadata: edit.frames are no two numbers of frames");
  const [first, end] = shown as [number, number];
  if (!(first >= 0 && first < end && end <= frames)) throw new FormatError(`Header.metadata: edit.frames ${first} to ${end} of ${frames} frames`);
  if (!Array.isArray(rotation) || !(rotation.length === 0 || isRotation(rotation))) throw new FormatError("Header.metadata: edit.rotation is no rotation of nine numbers");
  return { first, end, rotation: rotation.length === 0 ? null : (rotation as number[]) };
}

function isRotation(numbers: readonly unknown[]): boolean {
  if (numbers.length !== 9 || !numbers.every((number) => typeof number === "number" && Math.abs(number) <= 2)) return false;
  const [a, b, c, d, e, f, g, h, i] = numbers as number[];
  const rows = [[a, b, c], [d, e, f], [g, h, i]];
  const isStraight = rows.every((one, j) => rows.every((other, k) => Math.abs(one[0] * other[0] + one[1] * other[1] + one[2] * other[2] - (j === k ? 1 : 0)) <= CLOSE));
  return isStraight && a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0;
}
