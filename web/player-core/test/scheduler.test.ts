// Plans obey the laws of the format, whatever is at hand.

import { describe, expect, test } from "vitest";

import { Timeline } from "../src/time/clock.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Links, mostLayers } from "../src/format/links.ts";
import { Head } from "../src/format/reader.ts";
import type { Chunk } from "../src/format/reader.ts";
import { plan } from "../src/time/scheduler.ts";
import type { Holdings, Outlook, Plan } from "../src/time/scheduler.ts";
import { background, group, makeReel, stream } from "./reel.ts";
import type { FakeChunk } from "./reel.ts";

/** What is at hand, as tables that tests fill. */
class Table implements Holdings {
  readonly decoded = new Map<number, number>();
  readonly states = new Map<number, number>();
  readonly failed = new Set<number>();
  readonly reach = new Map<number, number>();
  bytes = 1000;
  seconds = 0;

  decodedAt = ({ number }: Chunk): number => this.decoded.get(number) ?? -1;
  stateAt = ({ number }: Chunk): number => this.states.get(number) ?? -1;
  isFailed = ({ number }: Chunk): boolean => this.failed.has(number);
  bytesOf = (): number => this.bytes;
  reachOf = ({ number }: Chunk): number => this.reach.get(number) ?? -1;
  secondsOf = (): number => this.seconds;
}

const OUTLOOK: Outlook = { time: 0, loop: false, direction: "normal", isBack: false, fetchSeconds: 4, decodeSeconds: 2, behindSeconds: 1, memory: 1e9, layers: 9, bearable: Infinity, isResting: false, speed: 1, exact: false };

function planned(file: Uint8Array, outlook: Partial<Outlook> = {}, table = new Table()): Plan {
  const head = Head.parse(file);
  const timeline = timelineOf(head);
  return plan(head, new Links(head), timeline, { ...OUTLOOK, ...outlook }, table);
}

function timelineOf(head: Head): Timeline {
  const { frameCount, duration } = head.info;
  return new Timeline(frameCount, (frame) => (frame < frameCount ? head.timestamp(frame) : duration));
}

const told = ({ steps }: Plan): [number, number, boolean, boolean][] => steps.map(({ chunk, layers, show, decode }) => [chunk.number, layers, show, decode]);
const numbers = ({ steps }: Plan): number[] => steps.map(({ chunk }) => chunk.number);

describe("ahead", () => {
  test("groups come in their order: decoded for a while, fetched for longer", () => {
    const steps = planned(stream(20, [100, 100]));
    expect(numbers(steps)).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
    expect(steps.steps.filter(({ decode }) => decode).map(({ chunk }) => chunk.number)).toEqual([0, 1, 2, 3, 4, 5]);
    expect([...steps.keep]).toEqual([0, 1, 2, 3, 4, 5]);
    expect(steps.steps.map(({ ahead }) => ahead)).toEqual([0, 0.4, 0.8, 1.2, 1.6, 2, 2.4, 2.8, 3.2, 3.6, 4].map((time) => expect.closeTo(time, 9) as number));
  });

  test("where time goes down groups come in the other order, from the end again with loop, and back up where it turns", () => {
    const back = { time: 1.9, isBack: true, direction: "reverse", fetchSeconds: 1, decodeSeconds: 0.5 } as const;
    const steps = planned(stream(20, [100, 100]), back);
    expect(numbers(steps)).toEqual([4, 3, 2]);
    expect(steps.steps.map(({ ahead }) => ahead)).toEqual([0, 0.3, 0.7].map((time) => expect.closeTo(time, 9) as number));
    expect(steps.steps.map(({ decode }) => decode)).toEqual([true, true, false]);
    expect([...steps.keep].sort((a, b) => a - b)).toEqual([3, 4, 5, 6, 7]); // those of a second that were shown, too
    const short = stream(4, [100]);
    expect(numbers(planned(short, { ...back, time: 0.5 }))).toEqual([1, 0]);
    expect(numbers(planned(short, { ...back, time: 0.5, loop: true }))).toEqual([1, 0, 9, 8]);
    expect(numbers(planned(short, { ...back, time: 0.5, loop: true, direction: "alternate" }))).toEqual([1, 0]);
    expect(numbers(planned(short, { ...back, time: 0.3, loop: true, direction: "alternate" }))).toEqual([0, 1]);
    expect(numbers(planned(short, { time: 3.7, direction: "alternate", fetchSeconds: 1 }))).toEqual([9, 8]);
  });

  test("of the end nothing comes; with loop the beginning does, in time", () => {
    expect(numbers(planned(stream(4, [100]), { time: 3.5 }))).toEqual([8, 9]);
    const again = planned(stream(4, [100]), { time: 3.5, loop: true, fetchSeconds: 1.5 });
    expect(numbers(again)).toEqual([8, 9, 0, 1, 2]);
    expect(again.steps.map(({ ahead }) => ahead)).toEqual([0, 0.1, 0.5, 0.9, 1.3].map((time) => expect.closeTo(time, 9) as number));
    expect(numbers(planned(stream(4, [100]), { time: 3.5, loop: true, fetchSeconds: 99 })).sort()).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    expect(numbers(planned(stream(4, [100]), { time: 0, loop: true, fetchSeconds: 99 }))).toHaveLength(10);
  });

  test("what is decoded is kept, so long behind the play head, and not wanted again", () => {
    const table = new Table();
    for (let chunk = 0; chunk < 10; chunk++) table.decoded.set(chunk, 0);
    const steps = planned(stream(20, [100, 100]), { time: 2.1, behindSeconds: 1, fetchSeconds: 2, decodeSeconds: 1 }, table);
    expect(steps.steps).toEqual([expect.objectContaining({ decode: false })]);
    expect([...steps.keep].sort()).toEqual([2, 3, 4, 5, 6, 7]);
  });

  test.each([1, 3])("of a frame rate that has the whole file within a second only some groups of %i tracks come, and are kept", (tracks) => {
    const groups = Array.from({ length: 6000 * tracks }, (_, k) => group(1, [1], { track: k % tracks }));
    const file = makeReel(groups, { frameRate: 1e5 });
    const first = planned(file);
    expect(first.steps).toHaveLength(Math.floor(4096 / tracks) * tracks);
    expect(numbers(first)).toEqual(Array.from(first.steps, (_, k) => k));
    const last = planned(file, { time: 5999e-5 });
    expect(last.keep.size).toBeLessThan(4096 + 2 * tracks);
    expect(last.keep).toContain(groups.length - 1);
  });

  test("memory ends what is decoded ahead, but for the shown group and the next", () => {
    const table = new Table();
    const decoded = (memory: number): number => planned(stream(20, [100]), { memory }, table).steps.filter(({ decode }) => decode).length;
    expect([decoded(1e9), decoded(4500), decoded(3000), decoded(0)]).toEqual([6, 4, 3, 2]);
  });

  test("empty groups are neither fetched nor decoded", () => {
    const file = makeReel([group(10, [1], { form: Form.EMPTY }), group(10, [50])], { frameRate: 25 });
    expect(numbers(planned(file))).toEqual([1]);
  });

  test("what cannot be decoded is not wanted, nor fetched", () => {
    const table = new Table();
    table.failed.add(1);
    expect(numbers(planned(stream(2, [100]), {}, table))).toEqual([0, 2, 3, 4]);
  });
});

describe("a chain", () => {
  const file = stream(20, [100, 100, 100], 10); // groups 0 to 9, 10 to 19 ...
  const at7 = { time: 2.9, fetchSeconds: 0.5, decodeSeconds: 0.5 };

  test("is decoded from its first group, without being shown", () => {
    expect(told(planned(file, at7)).slice(0, 8)).toEqual([...[0, 1, 2, 3, 4, 5, 6].map((chunk) => [chunk, 2, false, true]), [7, 2, true, true]]);
  });

  test("is decoded from the last state at hand", () => {
    const table = new Table();
    table.states.set(4, 2);
    expect(told(planned(file, at7, table)).slice(0, 3)).toEqual([[5, 2, false, true], [6, 2, false, true], [7, 2, true, true]]);
  });

  test("goes on with a state's layers where those are fewer, and rises at the next group that stands alone", () => {
    const table = new Table();
    for (let chunk = 0; chunk < 8; chunk++) table.decoded.set(chunk, 1);
    table.states.set(7, 1);
    const steps = planned(file, { time: 2.9, fetchSeconds: 2 }, table);
    expect(told(steps)).toEqual([[8, 1, true, true], [9, 1, true, true], [10, 2, true, true], [11, 2, true, true], [12, 2, true, true]]);
  });

  test("with exact is decoded again, finer, from its first group", () => {
    const table = new Table();
    for (let chunk = 0; chunk < 10; chunk++) [table.decoded, table.states].forEach((map) => map.set(chunk, 1));
    const steps = planned(file, { ...at7, exact: true }, table);
    expect(told(steps)).toEqual([...[0, 1, 2, 3, 4, 5, 6].map((chunk) => [chunk, 2, false, true]), [7, 2, true, true], [8, 2, true, true]]);
  });

  test("goes down at once, from the finer state", () => {
    const table = new Table();
    for (let chunk = 0; chunk < 10; chunk++) [table.decoded, table.states].forEach((map) => map.set(chunk, 2));
    expect(told(planned(file, { ...at7, exact: true, layers: 0 }, table))).toEqual([[7, 0, true, true], [8, 0, true, true]]);
    table.decoded.delete(8);
    expect(told(planned(file, { ...at7, layers: 0 }, table))).toEqual([[8, 0, true, true]]);
  });
});

test("the frame at the play head comes first, all that it needs in the file's order", () => {
  const other = { track: 1 };
  const chunks: FakeChunk[] = [
    background(100),
    group(10, [10], { dependsOn: [0] }),
    group(5, [10], other),
    group(10, [10], { ...other, dependsOn: [2] }),
    background(50, [0]),
    group(10, [10], { dependsOn: [4, 1] }),
    group(5, [10], { ...other, dependsOn: [3] }),
  ];
  const steps = planned(makeReel(chunks, { frameRate: 25 }), { time: 0.5 });
  expect(told(steps)).toEqual([
    [0, 0, false, true], [1, 0, false, true], [2, 0, false, true], [3, 0, true, true], [4, 0, true, true], [5, 0, true, true], [6, 0, true, true],
  ]);
  expect(steps.steps.map(({ ahead }) => ahead <= 0)).toEqual([true, true, true, true, true, true, false]);
});

describe("whatever the file and whatever is at hand", () => {
  /** Random files of some tracks, chains and backgrounds. */
  function randomFile(random: () => number): Uint8Array {
    const tracks = 1 + Math.floor(3 * random());
    const [ends, last] = [Array.from({ length: tracks }, () => 0), Array.from({ length: tracks }, () => -1)];
    const chunks: FakeChunk[] = [];
    let state = -1;
    while (Math.min(...ends) < 60) {
      const track = ends.indexOf(Math.min(...ends));
      if (random() < 0.2) state = chunks.push(background(10, state >= 0 && random() < 0.7 ? [state] : [])) - 1;
      const isEmpty = random() < 0.1;
      const frames = Math.min(1 + Math.floor(9 * random()), 60 - ends[track]);
      const isPredicted = !isEmpty && last[track] >= 0 && random() < 0.7;
      const dependsOn = [...(state >= 0 ? [state] : []), ...(isPredicted ? [last[track]] : [])];
      const layers = isPredicted ? chunks[last[track]].layers : Array.from({ length: 1 + Math.floor(3 * random()) }, () => 5);
      const number = chunks.push(group(frames, isEmpty ? [1] : layers, { track, dependsOn, form: isEmpty ? Form.EMPTY : Form.LAYERS })) - 1;
      last[track] = isEmpty ? -1 : number;
      ends[track] += frames;
    }
    return makeReel(chunks, { frameRate: 25 });
  }

  test("each step has what it needs when its turn comes, and the frame at the play head is complete", () => {
    let seed = 5;
    const random = (): number => (seed = (Math.imul(seed, 48271) >>> 0) % 2147483647) / 2147483647;
    let steps = 0;
    for (let round = 0; round < 400; round++) {
      const head = Head.parse(randomFile(random));
      const links = new Links(head);
      const table = new Table();
      for (const chunk of head.chunks) {
        if (random() < 0.3) table.decoded.set(chunk.number, Math.floor(random() * chunk.layers.length));
        if (random() < 0.3) table.states.set(chunk.number, Math.floor(random() * chunk.layers.length));
        if (random() < 0.03) for (const number of links.withDependents(chunk.number)) table.failed.add(number);
      }
      const time = random() * head.info.duration;
      const outlook = { ...OUTLOOK, time, loop: random() < 0.5, layers: Math.floor(3 * random()), exact: random() < 0.5, memory: random() * 1e5 };
      const made = plan(head, links, timelineOf(head), outlook, table);
      const states = new Map(table.states);
      const decoded = new Map(table.decoded);
      for (const { chunk, layers, show, decode } of made.steps) {
        steps++;
        expect(table.failed.has(chunk.number)).toBe(false);
        expect(layers).toBeLessThanOrEqual(mostLayers(chunk));
        const previous = links.previousOf(chunk);
        if (previous && decode) expect(states.get(previous.number) ?? -1).toBeGreaterThanOrEqual(Math.min(layers, mostLayers(previous)));
        if (decode) states.set(chunk.number, layers);
        if (decode && show) decoded.set(chunk.number, layers);
        if (show && decode) expect(made.keep.has(chunk.number)).toBe(true);
      }
      expect(new Set(numbers(made)).size).toBe(made.steps.length);
      const frame = timelineOf(head).frameAt(time);
      const shown = [...head.tracks.keys()].map((track) => head.chunkOfFrame(frame, track));
      for (const chunk of [...shown, head.staticOfFrame(frame)]) {
        if (chunk === null || chunk.form === Form.EMPTY || table.failed.has(chunk.number)) continue;
        expect(decoded.has(chunk.number)).toBe(true);
        if (outlook.exact && chunk.kind === "group") expect(decoded.get(chunk.number)).toBe(Math.min(outlook.layers, mostLayers(chunk)));
        expect(made.keep.has(chunk.number)).toBe(true);
      }
    }
    expect(steps).toBeGreaterThan(3000);
  });
});

describe("bytes at hand", () => {
  const file = stream(20, [100, 100, 100], 10);
  const coarse = (): Table => {
    const table = new Table();
    for (let chunk = 0; chunk < 4; chunk++) table.decoded.set(chunk, 0);
    for (let chunk = 0; chunk < 4; chunk++) table.states.set(chunk, 0);
    for (let chunk = 0; chunk < 6; chunk++) table.reach.set(chunk, 2);
    return table;
  };
  const near = { time: 0.1, fetchSeconds: 1, decodeSeconds: 1, layers: 0 };

  test("are decoded again, finer, with all the time at rest", () => {
    expect(told(planned(file, { ...near, isResting: true }, coarse())).slice(0, 3)).toEqual([[0, 2, true, true], [1, 2, true, true], [2, 2, true, true]]);
  });

  test("are decoded finer while it plays where there is time for the chain before it was shown", () => {
    const table = coarse();
    table.seconds = 0.12; // half of what is left of group 0 is 0.15 s
    expect(told(planned(file, near, table))).toEqual([[0, 2, true, true], [1, 2, true, true], [2, 2, true, true]]);
    table.seconds = 0.3;
    expect(planned(file, near, table).steps).toEqual([]);
  });

  test("of more layers than decoding bears are of no use while it plays", () => {
    expect(told(planned(file, { ...near, bearable: 1 }, coarse()))[0]).toEqual([0, 1, true, true]);
  });

  test("of a chain are as good as those of its poorest group", () => {
    const table = coarse();
    table.reach.set(1, 1);
    expect(told(planned(file, { ...near, isResting: true }, table)).slice(0, 3)).toEqual([[0, 2, true, true], [1, 1, true, true], [2, 1, true, true]]);
  });

  test("do until better ones come, where a group is shown soon: its finer layers are still fetched", () => {
    const table = new Table();
    const [first, , third] = planned(file, { ...near, layers: 2 }, table).steps;
    expect([first.least, first.fetched, third.least]).toEqual([0, 2, 2]);
    table.decoded.set(0, 0);
    table.states.set(0, 0);
    const { more, steps } = planned(file, { ...near, layers: 2 }, table);
    expect(more.map(({ chunk, layers }) => [chunk.number, layers])).toEqual([[0, 2]]);
    expect(steps.map(({ chunk, layers, fetched }) => [chunk.number, layers, fetched])).toEqual([[1, 0, 2], [2, 0, 2]]);
  });
});
