// Turns a recording upright: its file names the axis that points up, in the picture that is y.

import type { Box, Info } from "@meshreel/player-core/types";

export type Up = "y" | "z" | "-y" | "-z";

const TURNS: Readonly<Record<Up, number>> = { y: 0, z: -Math.PI / 2, "-y": Math.PI, "-z": Math.PI / 2 };

/** Radians about x that turn the up axis to y: the axis that is given, else the one that the file names, else y. */
export function turnOf(metadata: Info["metadata"], given: Up | null = null): number {
  const up = given ?? metadata.up;
  return typeof up === "string" && Object.hasOwn(TURNS, up) ? TURNS[up as Up] : 0;
}

/** The box around a box that is turned so, by a multiple of a right angle. */
export function stoodUp({ minimum, size }: Box, turn: number): Box {
  const [cos, sin] = [Math.round(Math.cos(turn)), Math.round(Math.sin(turn))];
  const turned = ([x, y, z]: readonly [number, number, number]): [number, number, number] => [x, cos * y - sin * z, sin * y + cos * z];
  const from = turned(minimum);
  const span = turned(size);
  const low = from.map((value, k) => value + Math.min(0, span[k])) as [number, number, number];
  return { minimum: low, size: span.map(Math.abs) as [number, number, number] };
}
