// Answers as a CSV: one row a trial, quoted as RFC 4180 has it.

import type { File } from "./description.ts";
import { RESULTS, type Result } from "./showing.ts";

/** The answer to one trial. */
export interface Answer {
  readonly study: string;
  readonly seed: number;
  readonly participant: string;
  readonly trial: number; // from 1, in the order of the participant
  readonly pair: string;
  readonly a: string;
  readonly b: string;
  readonly network: string;
  readonly show: string;
  readonly first: File; // that was shown as A
  readonly choice: File | "none"; // a file, not a side
  readonly seconds: string; // from the end of the first showing to the choice
  readonly replays: number;
  readonly hidden: number; // times that the page was out of sight before the choice
  readonly width: number; // of a picture, CSS pixels
  readonly height: number;
  readonly answered: string; // date and time, UTC
  readonly results: Readonly<Record<File, Result>>; // of the first showing
}

const COLUMNS = ["study", "seed", "participant", "trial", "pair", "a", "b", "network", "show", "first", "choice", "seconds", "replays", "hidden", "width", "height", "answered"] as const;
export const HEAD: readonly string[] = [...COLUMNS, ...(["a", "b"] as const).flatMap((file) => RESULTS.map((name) => `${file}_${name}`))];

export function asCsv(answers: readonly Answer[]): string {
  const rows = answers.map((answer) => [...COLUMNS.map((name) => answer[name]), ...(["a", "b"] as const).flatMap((file) => RESULTS.map((name) => answer.results[file][name]))]);
  return [HEAD, ...rows].map((row) => `${row.map(quoted).join(",")}\r\n`).join("");
}

function quoted(value: string | number): string {
  const text = String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
