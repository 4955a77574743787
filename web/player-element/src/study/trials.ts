// Which pair a participant sees when, and on which side: drawn from the study's seed and the participant's name.

import type { File, Pair, Study } from "./description.ts";

export interface Trial {
  readonly pair: Pair;
  readonly first: File; // shown as A: at the left, or first
}

/** The same for equal seeds and names. In half of the trials, as nearly as can be, file a is first. */
export function trialsOf({ pairs, order, seed }: Study, participant: string): Trial[] {
  const random = generator(`${seed} ${participant}`);
  const sides = shuffled(pairs.map((_, k): File => (k % 2 === 0 ? "a" : "b")), random);
  const flip = random() < 0.5; // else of an odd number of trials more would begin with a, for all participants
  const shown = order === "shuffled" ? shuffled(pairs, random) : pairs;
  return shown.map((pair, k) => ({ pair, first: (sides[k] === "a") !== flip ? "a" : "b" }));
}

/** Numbers from 0 to below 1 that follow from a text: FNV-1a of its UTF-16 units, and steps of a congruential generator modulo 2^31 - 1. */
function generator(text: string): () => number {
  let hash = 0x811c9dc5;
  for (let k = 0; k < text.length; k++) hash = Math.imul(hash ^ text.charCodeAt(k), 0x01000193) >>> 0;
  let state = (hash % 0x7ffffffe) + 1;
  const next = (): number => (state = (state * 48271) % 0x7fffffff) / 0x7fffffff;
  for (let k = 0; k < 8; k++) next(); // names that differ in a letter begin close together
  return next;
}

function shuffled<T>(values: readonly T[], random: () => number): T[] {
  const found = [...values];
  for (let k = found.length - 1; k > 0; k--) {
    const other = Math.floor(random() * (k + 1));
    [found[k], found[other]] = [found[other]!, found[k]!];
  }
  return found;
}
