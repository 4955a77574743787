// Edits of a file: which of its coded frames are shown, and how they are turned. Beside format/edit.py.

import { FormatError } from "../errors.ts";
import { EDITED } from "./layout.gen.ts";

export interface Edit {
  readonly shown: readonly (readonly [number, number])[]; // ranges of coded frames that are shown, end excluded, in order
  readonly rotation: readonly number[] | null; // about the header's origin, nine numbers, row by row
}

const CLOSE = 1e-6; // to a rotation

/** The edit of a file of so many coded frames. FormatError for one that this player cannot follow. */
export function editOf(metadata: Readonly<Record<string, unknown>>, flags: number, frames: number): Edit {
  const item = flags & EDITED ? metadata.edit : {};
  if (typeof item !== "object" || item === null || Array.isArray(item)) throw new FormatError("Header.metadata: no edit");
  const { frames: ends = [0, frames], rotation = [], ...others } = item as Record<string, unknown>;
  if (Object.keys(others).length > 0) throw new FormatError("Header.metadata: an edit that this player does not know, update it", "newer");
  const isPaired = Array.isArray(ends) && ends.length > 0 && ends.length % 2 === 0 && ends.every(Number.isInteger);
  if (!isPaired) throw new FormatError("Header.metadata: edit.frames are no pairs of numbers of frames");
  const rising = [-1, ...(ends as number[]), frames + 1];
  if (rising.some((end, k) => k > 0 && end <= rising[k - 1])) throw new FormatError(`Header.metadata: edit.frames ${String(ends).slice(0, 80)} of ${frames} frames`);
  const shown = (ends as number[]).flatMap((end, k): [number, number][] => (k % 2 === 0 ? [[end, (ends as number[])[k + 1]]] : []));
  if (!Array.isArray(rotation) || !(rotation.length === 0 || isRotation(rotation))) throw new FormatError("Header.metadata: edit.rotation is no rotation of nine numbers");
  return { shown, rotation: rotation.length === 0 ? null : (rotation as number[]) };
}

/** The number that a frame shown has among the coded ones; those before and behind all are counted on. */
export function codedFrame({ shown }: Edit, frame: number): number {
  let coded = shown[0][0] + frame;
  for (let k = 1; k < shown.length && coded >= shown[k - 1][1]; k++) coded += shown[k][0] - shown[k - 1][1];
  return coded;
}

/** Of a group of `count` coded frames from `coded` on: the number of its first frame, as the frames that it shows are numbered, and these, end excluded. FormatError where they are in two ranges. */
export function placed({ shown }: Edit, coded: number, count: number): { firstFrame: number; shownFirst: number; shownEnd: number } {
  let low = 0;
  let at = 0;
  for (; at < shown.length - 1 && shown[at][1] <= coded; at++) low += shown[at][1] - shown[at][0];
  if (at + 1 < shown.length && shown[at + 1][0] < coded + count) throw new FormatError("Header.metadata: edit.frames have two ranges with frames of one group");
  const firstFrame = low + coded - shown[at][0];
  const high = low + shown[at][1] - shown[at][0];
  const shownFirst = Math.min(Math.max(firstFrame, low), high);
  return { firstFrame, shownFirst, shownEnd: Math.max(Math.min(firstFrame + count, high), shownFirst) };
}

function isRotation(numbers: readonly unknown[]): boolean {
  if (numbers.length !== 9 || !numbers.every((number) => typeof number === "number" && Math.abs(number) <= 2)) return false;
  const [a, b, c, d, e, f, g, h, i] = numbers as number[];
  const rows = [[a, b, c], [d, e, f], [g, h, i]];
  const isStraight = rows.every((one, j) => rows.every((other, k) => Math.abs(one[0] * other[0] + one[1] * other[1] + one[2] * other[2] - (j === k ? 1 : 0)) <= CLOSE));
  return isStraight && a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0;
}
