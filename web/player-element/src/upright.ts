// Standing a recording on its feet: its file tells which of its axes points up, the picture's is y.

import type { Box, Info } from "@meshreel/player-core/types";

const TURNS: Readonly<Record<string, number>> = { "-y": Math.PI, z: -Math.PI / 2, "-z": Math.PI / 2 };

/** Radians about x that bring the axis of a file's `up` to y; 0 where it tells none that there is. */
export function turnOf(metadata: Info["metadata"]): number {
  const { up } = metadata;
  return typeof up === "string" && Object.hasOwn(TURNS, up) ? TURNS[up] : 0;
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
