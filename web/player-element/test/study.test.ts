// What a study's page reads, draws and writes, without a page; and the example of docs/player.md.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import type { Playback, Shown } from "@meshreel/player-core/types";
import { readTrace } from "@meshreel/player-core/net/trace";
import { describe, expect, test } from "vitest";
import { ROOT } from "../../test/python.ts";
import { cameraAt } from "../src/study/camera_path.ts";
import { readStudy, type Pair } from "../src/study/description.ts";
import { Showing } from "../src/study/showing.ts";
import { type Answer, asCsv, HEAD } from "../src/study/table.ts";
import { trialsOf } from "../src/study/trials.ts";

const ADDRESS = "https://example.org/studies/walk.study.json";
const PAIR = { a: "one.reel", b: "other.reel" };
const read = (description: object) => readStudy(JSON.stringify(description), ADDRESS);

describe("a description", () => {
  test("needs a name and pairs, and has addresses relative to its own", () => {
    expect(read({ name: "Walk", pairs: [{ a: "one.reel", b: "../other.reel" }] })).toEqual({
      name: "Walk", question: "Which one looks better?", instructions: "", show: "beside", order: "shuffled", seed: 0,
      pairs: [{ name: "1", a: "https://example.org/studies/one.reel", b: "https://example.org/other.reel", network: null, camera: null, layers: "auto" }],
    });
  });

  test("says for all pairs what a pair may say for itself", () => {
    const own = { ...PAIR, name: "own", network: "5g.network.csv", camera: [[0, 1, 1, 1, 0, 0, 0]], layers: 2 };
    const { pairs } = read({ name: "Walk", network: "/fixed.network.csv", camera: [[0, 0, 1, 4, 0, 1, 0]], layers: 0, pairs: [PAIR, own] });
    expect(pairs).toMatchObject([
      { name: "1", network: "https://example.org/fixed.network.csv", camera: [[0, 0, 1, 4, 0, 1, 0]], layers: 0 },
      { name: "own", network: "https://example.org/studies/5g.network.csv", camera: [[0, 1, 1, 1, 0, 0, 0]], layers: 2 },
    ]);
  });

  test.each([
    ["[]", ": [] is given, but an object with braces is needed"],
    ["{", " is no JSON: "],
    [{ pairs: [PAIR] }, ", name: nothing is given, but a text in quotes is needed"],
    [{ name: " ", pairs: [PAIR] }, ', name: " " is given, but a text in quotes is needed'],
    [{ name: "x" }, ", pairs: nothing is given, but a list of pairs is needed"],
    [{ name: "x", pairs: [] }, ", pairs: [] is given, but a list of pairs is needed"],
    [{ name: "x", pairs: [PAIR], netwerk: "a.csv" }, ': "netwerk" is given, but the keys are name, question, instructions, show, order, seed, network, camera, layers, pairs'],
    [{ name: "x", pairs: [PAIR, 7] }, ", pairs[1]: 7 is given, but an object with braces is needed"],
    [{ name: "x", pairs: [{ a: "one.reel" }] }, ", pairs[0].b: nothing is given, but a text in quotes is needed"],
    [{ name: "x", pairs: [{ a: "http://", b: "b" }] }, ', pairs[0].a: "http://" is given, but an address is needed'],
    [{ name: "x", pairs: [PAIR], show: "below" }, ', show: "below" is given, but one of beside, in turn is needed'],
    [{ name: "x", pairs: [PAIR], order: 1 }, ", order: 1 is given, but one of shuffled, given is needed"],
    [{ name: "x", pairs: [PAIR], seed: -1 }, ", seed: -1 is given, but a whole number from 0 is needed"],
    [{ name: "x", pairs: [PAIR], layers: "all" }, ', layers: "all" is given, but a whole number from 0 is needed'],
    [{ name: "x", pairs: [{ ...PAIR, network: 5 }] }, ", pairs[0].network: 5 is given, but a text in quotes is needed"],
    [{ name: "x", pairs: [PAIR], camera: [] }, ", camera: [] is given, but a list of rows is needed"],
    [{ name: "x", pairs: [{ ...PAIR, camera: [[0, 1, 2]] }] }, ", pairs[0].camera: [0,1,2] is given, but a row is seven numbers"],
    [{ name: "x", pairs: [PAIR], camera: [[1, 0, 0, 1, 0, 0, 0], [1, 0, 0, 1, 0, 0, 0]] }, ", camera: [1,0,0,1,0,0,0] is given, but times are from 0 and rise from row to row"],
  ])("that is %j is refused, and told what to write", (description, message) => {
    const text = typeof description === "string" ? description : JSON.stringify(description);
    expect(() => readStudy(text, ADDRESS)).toThrow(`${ADDRESS}${message}`);
  });
});

test("the camera goes on straight lines from row to row, and stands before and behind them", () => {
  const path = [[1, 0, 1, 4, 0, 1, 0], [3, 4, 1, 0, 0, 2, 0], [4, 4, 1, 0, 0, 0, 0]];
  const at = (seconds: number): number[] => cameraAt(path, seconds).split(",").map(Number);
  expect([0, 1, 1.5, 2, 3, 3.5, 4, 9].map(at)).toEqual([
    [0, 1, 4, 0, 1, 0], [0, 1, 4, 0, 1, 0], [1, 1, 3, 0, 1.25, 0], [2, 1, 2, 0, 1.5, 0], [4, 1, 0, 0, 2, 0], [4, 1, 0, 0, 1, 0], [4, 1, 0, 0, 0, 0], [4, 1, 0, 0, 0, 0],
  ]);
});

describe("the trials of a participant", () => {
  const pairs = Array.from({ length: 7 }, (_, k): Pair => ({ name: `${k}`, a: "a", b: "b", network: null, camera: null, layers: "auto" }));
  const study = { ...read({ name: "x", pairs: [PAIR] }), pairs };
  const drawn = (participant: string, seed = 0, order: "shuffled" | "given" = "shuffled") => trialsOf({ ...study, seed, order }, participant).map(({ pair, first }) => `${pair.name}${first}`);

  test("are all pairs, the same each time, and others for other names and seeds", () => {
    expect(drawn("P1").map((trial) => trial[0]).sort()).toEqual(pairs.map(({ name }) => name));
    expect(drawn("P1")).toEqual(drawn("P1"));
    expect(new Set([...Array.from({ length: 20 }, (_, k) => drawn(`P${k}`).join()), drawn("P1", 1).join()]).size).toBe(21);
    expect(drawn("P1", 0, "given").map((trial) => trial[0])).toEqual(pairs.map(({ name }) => name));
  });

  test("have each file first in half of them, and each pair either way over many participants", () => {
    const all = Array.from({ length: 400 }, (_, k) => drawn(`P${k}`));
    for (const trials of all) expect([3, 4]).toContain(trials.filter((trial) => trial.endsWith("a")).length);
    for (const { name } of pairs) {
      expect(Math.abs(all.filter((trials) => trials.includes(`${name}a`)).length - 200)).toBeLessThan(60); // six deviations of a fair coin
      expect(Math.abs(all.filter((trials) => trials[0]!.startsWith(name)).length - 400 / 7)).toBeLessThan(42);
    }
  });
});

test("a showing has the layers of each group in its first picture, weighted by frames, and what its playback counts", () => {
  const group = (firstFrame: number, frameCount: number, layers: number) => ({ firstFrame, frameCount, layers });
  const pictures = [[group(0, 10, 1), group(0, 30, 3)], [group(0, 10, 2), null], [group(10, 20, 0), group(0, 30, 3)]];
  let shown: unknown = null;
  const playback = Object.assign(new EventTarget(), { paused: false, stats: { stalls: 2, fetchedBytes: 1234 }, update: () => shown as Shown });
  const showing = new Showing();
  showing.watch(playback as unknown as Playback);
  shown = { groups: [group(0, 10, 0), null] };
  playback.update(); // before it plays nothing is seen
  playback.dispatchEvent(new Event("playing"));
  for (const groups of pictures) {
    shown = { groups };
    expect(playback.update()).toBe(shown);
  }
  expect(showing.result()).toMatchObject({ layers: "1.667", layers_by_group: "0:1 10:0 | 0:3", stalls: 2, stalled_s: "0.000", bytes: 1234 });
});

test("a CSV quotes what needs it, and has a row for each answer", () => {
  const result = { start_s: "0.1", stalls: 0, stalled_s: "0.000", layers: "1.500", layers_by_group: "0:1 10:2", bytes: 10 };
  const answer: Answer = {
    study: 'A "study", two', seed: 1, participant: "P1", trial: 1, pair: "walk", a: "a.reel", b: "b.reel", network: "", show: "in turn", first: "b", choice: "a",
    seconds: "2.000", replays: 0, hidden: 0, width: 600, height: 400, answered: "2026-01-02T03:04:05.000Z", results: { a: result, b: { ...result, bytes: 20 } },
  };
  const row = '"A ""study"", two",1,P1,1,walk,a.reel,b.reel,,in turn,b,a,2.000,0,0,600,400,2026-01-02T03:04:05.000Z,0.1,0,0.000,1.500,0:1 10:2,10,0.1,0,0.000,1.500,0:1 10:2,20';
  expect(asCsv([answer])).toBe(`${HEAD.join(",")}\r\n${row}\r\n`);
});

describe("docs/player.md", () => {
  const section = readFileSync(join(ROOT, "docs/player.md"), "utf8").split("\n## A study\n")[1]!.split("\n## ")[0]!;
  const columns = (heading: string): string[] => [...section.split(heading)[1]!.split("\n\n")[1]!.matchAll(/^\| (`.*?`) \|/gm)].flatMap(([, names]) => names!.match(/\w+/g)!);

  test("has an example of a study that is read, and tells of each key", () => {
    const [example] = /(?<=```json\n)[\s\S]*?(?=```)/.exec(section)!;
    const study = readStudy(example!, ADDRESS);
    expect(study.pairs.length).toBeGreaterThan(1);
    const told = columns("### Description");
    expect(() => read({ name: "x", pairs: [{ ...PAIR, none: 1 }] })).toThrow(/the keys are/);
    const known = ["name", "question", "instructions", "show", "order", "seed", "pairs", "network", "camera", "layers", "a", "b"];
    expect(new Set(told)).toEqual(new Set(known));
  });

  test("tells of each column of the CSV, and of no other", () => {
    const told = columns("### Answers").flatMap((name) => (name.startsWith("_") ? [`a${name}`, `b${name}`] : [name]));
    expect(new Set(told)).toEqual(new Set(HEAD));
  });

  test("names each network trace of the bench, and these are read", () => {
    const folder = join(ROOT, "bench/src/meshreel_bench/networks");
    const files = readdirSync(folder).filter((name) => name.endsWith(".network.csv"));
    expect(files.length).toBeGreaterThan(2);
    for (const name of files) {
      expect(section).toContain(`\`${name}\``);
      expect(readTrace(readFileSync(join(folder, name), "utf8"), name).duration).toBeCloseTo(240, 6);
    }
  });
});
