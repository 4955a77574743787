// The description of a study: a JSON file that a researcher writes. Errors name the file, the place in it, the value, and what to write instead.

import { readCameraPath, type CameraPath } from "./camera_path.ts";

export type File = "a" | "b"; // of a pair
export const SHOWS = ["beside", "in turn"] as const;
export const ORDERS = ["shuffled", "given"] as const;

/** Two recordings that are compared; addresses are whole. */
export interface Pair {
  readonly name: string;
  readonly a: string;
  readonly b: string;
  readonly network: string | null; // address of a trace; null: all bytes are there at once
  readonly camera: CameraPath | null; // null: the view that each recording begins with
  readonly layers: number | "auto"; // beyond the first, as the player's attribute
}

export interface Study {
  readonly name: string;
  readonly question: string;
  readonly instructions: string;
  readonly show: (typeof SHOWS)[number];
  readonly order: (typeof ORDERS)[number];
  readonly seed: number;
  readonly pairs: readonly Pair[];
}

const OF_PAIR = ["network", "camera", "layers"] as const; // what stands above all pairs may stand in one, too
const KEYS = ["name", "question", "instructions", "show", "order", "seed", ...OF_PAIR, "pairs"];
const KEYS_OF_PAIR = ["name", "a", "b", ...OF_PAIR];
const QUESTION = "Which one looks better?";

type Given = Readonly<Record<string, unknown>>;

/** Reads a description that was fetched from a whole address, to which its own addresses are relative. */
export function readStudy(text: string, address: string): Study {
  const refuse = (place: string, value: unknown, wanted: string): never => {
    throw new Error(`${address}${place === "" ? "" : `, ${place}`}: ${value === undefined ? "nothing" : JSON.stringify(value)} is given, but ${wanted}`);
  };
  const object = (value: unknown, place: string, keys: readonly string[]): Given => {
    if (typeof value !== "object" || value === null || Array.isArray(value)) return refuse(place, value, "an object with braces is needed");
    for (const key of Object.keys(value)) if (!keys.includes(key)) refuse(place, key, `the keys are ${keys.join(", ")}`);
    return value as Given;
  };
  const words = (value: unknown, place: string): string => (typeof value === "string" && value.trim() !== "" ? value.trim() : refuse(place, value, "a text in quotes is needed"));
  const oneOf = <T extends string>(value: unknown, place: string, known: readonly T[]): T => (known as readonly unknown[]).includes(value) ? (value as T) : refuse(place, value, `one of ${known.join(", ")} is needed`);
  const whole = (value: unknown, place: string): number => (Number.isSafeInteger(value) && (value as number) >= 0 ? (value as number) : refuse(place, value, "a whole number from 0 is needed"));
  const link = (value: unknown, place: string): string => {
    const written = words(value, place);
    return URL.canParse(written, address) ? new URL(written, address).href : refuse(place, value, "an address is needed");
  };

  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch (error) {
    throw new Error(`${address} is no JSON: ${(error as Error).message}`, { cause: error });
  }
  const given = object(parsed, "", KEYS);
  const pairOf = (value: unknown, k: number): Pair => {
    const at = (key: string): string => `pairs[${k}].${key}`;
    const own = object(value, `pairs[${k}]`, KEYS_OF_PAIR);
    const place = (key: (typeof OF_PAIR)[number]): string => (key in own ? at(key) : key);
    const { network, camera, layers } = Object.fromEntries(OF_PAIR.map((key) => [key, own[key] ?? given[key]])) as Given;
    const [a, b] = [link(own.a, at("a")), link(own.b, at("b"))];
    return {
      name: own.name === undefined ? `${k + 1}` : words(own.name, at("name")),
      a,
      b,
      network: network === undefined ? null : link(network, place("network")),
      camera: camera === undefined ? null : readCameraPath(camera, (what, wanted) => refuse(place("camera"), what, wanted)),
      layers: layers === undefined || layers === "auto" ? "auto" : whole(layers, place("layers")),
    };
  };
  if (!Array.isArray(given.pairs) || given.pairs.length === 0) refuse("pairs", given.pairs, 'a list of pairs is needed, as [{"a": "one.reel", "b": "other.reel"}]');
  return {
    name: words(given.name, "name"),
    question: given.question === undefined ? QUESTION : words(given.question, "question"),
    instructions: given.instructions === undefined ? "" : words(given.instructions, "instructions"),
    show: oneOf(given.show ?? SHOWS[0], "show", SHOWS),
    order: oneOf(given.order ?? ORDERS[0], "order", ORDERS),
    seed: whole(given.seed ?? 0, "seed"),
    pairs: (given.pairs as unknown[]).map(pairOf),
  };
}
