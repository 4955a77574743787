// docs/player.md tells of the attributes, parameters, events and keys that there are, and of no others.

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { describe, expect, test } from "vitest";
import { OBSERVED, PROPERTIES } from "../src/attributes.ts";
import { PASSED } from "../src/events.ts";
import { KEYS } from "../src/keyboard.ts";
import { readParameters } from "../src/parameters.ts";

const TEXT = readFileSync(fileURLToPath(new URL("../../../docs/player.md", import.meta.url)), "utf8");

/** What stands below a heading, up to the next. */
function section(heading: string): string {
  const start = TEXT.indexOf(`\n## ${heading}\n`);
  expect(start, heading).toBeGreaterThanOrEqual(0);
  const end = TEXT.indexOf("\n## ", start + 1);
  return TEXT.slice(start, end < 0 ? undefined : end);
}

/** Words in code font of a column of the tables of a section. */
function named(text: string, column: number): string[] {
  const rows = text.split("\n").filter((line) => /^\| `/.test(line));
  return rows.flatMap((row) => [...row.split("|")[column + 1]!.matchAll(/`(\w+)(?:="\w+")?`/g)].map((match) => match[1]!));
}

describe("docs/player.md", () => {
  const [attributes] = section("Attributes, properties, events").split("As `HTMLMediaElement`");

  test("has every attribute and every property that it sets", () => {
    expect(new Set(named(attributes!, 0))).toEqual(new Set([...OBSERVED, "preload"]));
    expect(new Set(named(attributes!, 1))).toEqual(new Set(PROPERTIES.filter((name) => name !== "currentTime")));
  });

  test("has every event that comes from the playback", () => {
    const events = section("Attributes, properties, events").split("Events as a media element has them")[1]!;
    const told = new Set([...events.matchAll(/`(\w+)`/g)].map((match) => match[1]));
    for (const name of PASSED) expect(told, name).toContain(name);
  });

  test("has only parameters that the page takes", () => {
    const names = named(section("URL parameters"), 0);
    expect(names.length).toBeGreaterThan(12);
    const taken = readParameters(`?${names.map((name) => `${name}=1`).join("&")}`);
    expect(new Set([...taken.attributes.keys(), "t", "bench", "study", "participant"])).toEqual(new Set(names));
    expect([taken.time, taken.bench, taken.study, taken.participant]).toEqual([1, 1, "1", "1"]);
  });

  test("has a row for each row of the help overlay, and Escape", () => {
    const rows = section("Keys").split("\n").filter((line) => line.startsWith("| ") && !/^\| (key|---)/.test(line));
    const simple = (text: string): string => text.toLowerCase().replaceAll(/ with | and | to |[+, −-]/g, "");
    expect(new Set(rows.map((row) => simple(row.split("|")[1]!)))).toEqual(new Set([...KEYS.map(({ shown }) => simple(shown)), "escape"]));
  });
});
