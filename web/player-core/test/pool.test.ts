// Jobs and workers.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import { crc32 } from "../src/format/crc.ts";
import { Form } from "../src/format/layout.gen.ts";
import { WorkerPool } from "../src/time/pool.ts";
import type { Outcome, Share } from "../src/time/pool.ts";
import { FakeWorkers } from "./fake_workers.ts";
import { pass } from "./rig.ts";

let workers: FakeWorkers;
let pool: WorkerPool;
let share: Share;
let outcomes: Map<number, Outcome>;

beforeEach(() => {
  vi.useFakeTimers();
  workers = new FakeWorkers();
  workers.msOf = () => 100;
  outcomes = new Map();
});

afterEach(() => {
  pool.dispose();
  vi.useRealTimers();
  expect(workers.offences).toEqual([]);
});

function open(count: number, silenceMs?: number): void {
  pool = new WorkerPool(workers.setup(count, silenceMs));
  share = pool.open();
}

function submit(chunk: number, lane = chunk, previous: number | null = null, of = share): void {
  of.submit({
    lane,
    start: () => {
      const payload = Uint8Array.of(1, 2, 3);
      const place = { track: 0, firstFrame: 10 * chunk, frameCount: 10, scale: 1 };
      const ranges = [{ size: 3, crc: crc32(payload) }];
      return { chunk, kind: "group", form: Form.LAYERS, payload, ranges, companions: [], layers: null, previous, stateOnly: false, textured: false, ...place };
    },
    settle: (outcome) => outcomes.set(chunk, outcome),
  });
}

const kinds = (): Record<number, string> => Object.fromEntries([...outcomes].map(([chunk, { kind }]) => [chunk, kind]));

test("as many jobs are done at once as there are workers, one in each, in their order", async () => {
  open(3);
  for (let chunk = 0; chunk < 7; chunk++) submit(chunk);
  await pass(0.002);
  expect(workers.chunks).toEqual([0, 1, 2]);
  expect(new Set(workers.begun.map(({ worker }) => worker)).size).toBe(3);
  await pass(0.1);
  expect(workers.chunks).toEqual([0, 1, 2, 3, 4, 5]);
  await pass(1);
  expect(kinds()).toEqual(Object.fromEntries([0, 1, 2, 3, 4, 5, 6].map((chunk) => [chunk, "decoded"])));
});

test("a lane stays in one worker, in its order, and others do not wait for it", async () => {
  open(2);
  submit(0, 0);
  submit(1, 0, 0);
  submit(2, 0, 1);
  submit(10, 10);
  submit(11, 10, 10);
  await pass(1);
  expect(new Set(workers.begun.filter(({ job }) => job.chunk < 10).map(({ worker }) => worker)).size).toBe(1);
  expect(workers.chunks).toEqual([0, 10, 1, 11, 2]);
  expect([...outcomes.values()].every(({ kind }) => kind === "decoded")).toBe(true);
});

test("lanes are spread over workers, also where one comes after the other", async () => {
  open(3);
  for (let lane = 0; lane < 9; lane++) {
    submit(lane, lane);
    await pass(0.2);
  }
  const counts = [0, 1, 2].map((number) => workers.begun.filter(({ worker }) => worker === number).length);
  expect(counts).toEqual([3, 3, 3]);
});

test("jobs that have not started can be cancelled; those that have are done", async () => {
  open(1);
  for (let chunk = 0; chunk < 5; chunk++) submit(chunk);
  await pass(0.01);
  share.clear();
  await pass(1);
  expect(workers.chunks).toEqual([0]);
  expect([...outcomes.keys()]).toEqual([0]);
  submit(9);
  await pass(1);
  expect(workers.chunks).toEqual([0, 9]);
});

test("no job is sent before its worker has started", async () => {
  workers.startMs = 5000;
  open(1);
  submit(0);
  await pass(4);
  expect(workers.begun).toEqual([]);
  await pass(2);
  expect(workers.chunks).toEqual([0]);
});

describe("a worker that dies", () => {
  test("fails its job; the next one is done by another, which knows no states", async () => {
    open(1);
    submit(0);
    submit(1, 0, 0);
    await pass(0.15);
    expect(share.isAt(0, (outcomes.get(0) as { worker: number }).worker)).toBe(true);
    workers.workers[0].crash("trap");
    submit(2, 0, 1);
    await pass(1);
    expect(outcomes.get(1)).toEqual({ kind: "failed", message: "its decoder crashed (trap)", damage: [], missingState: false });
    expect(outcomes.get(2)).toMatchObject({ kind: "failed", missingState: true });
    expect(share.isAt(0, (outcomes.get(0) as { worker: number }).worker)).toBe(false);
    expect(workers.workers.map(({ isTerminated }) => isTerminated)).toEqual([true, false]);
  });

  test("between jobs is replaced, and nobody hears of it", async () => {
    open(1);
    submit(0);
    await pass(1);
    workers.workers[0].crash();
    submit(1);
    await pass(1);
    expect(kinds()).toEqual({ 0: "decoded", 1: "decoded" });
  });

  test("without a word is found out by its silence", async () => {
    workers.onJob = (_, { chunk }) => (chunk === 0 ? "say nothing" : "go on");
    open(1, 500);
    submit(0);
    submit(1);
    await pass(0.4);
    expect(outcomes.size).toBe(0);
    await pass(1);
    expect(outcomes.get(0)).toMatchObject({ kind: "failed", message: "its decoder crashed (no answer for 0.5 s)" });
    expect(outcomes.get(1)).toMatchObject({ kind: "decoded" });
  });

  test("by an answer that cannot be read is replaced, too", async () => {
    open(1);
    submit(0);
    await pass(0.01);
    workers.workers[0].onmessageerror!(null);
    expect(outcomes.get(0)).toMatchObject({ kind: "failed" });
  });

  test("is not waited for: idle ones do not count as silent", async () => {
    open(2, 500);
    await pass(60);
    expect(workers.workers).toHaveLength(2);
  });
});

describe("workers that cannot be started", () => {
  test("are given up after three, and the reason is told once", async () => {
    workers.startMs = 1e9;
    open(1);
    const fatal: string[] = [];
    share.onfatal = ({ message }) => fatal.push(message);
    submit(0);
    for (let k = 0; k < 3; k++) workers.workers.at(-1)!.crash(`no wasm, ${k}`);
    await pass(1);
    expect(workers.workers).toHaveLength(3);
    expect(fatal).toEqual(["the decoder cannot be started: no wasm, 2; load the page again"]);
    expect(workers.begun).toEqual([]);
    const late: string[] = [];
    pool.open().onfatal = ({ message }) => late.push(message);
    await pass(0.1);
    expect(late).toEqual(fatal);
  });

  test("because none can be made are told of as well", async () => {
    pool = new WorkerPool({ ...workers.setup(), create: () => { throw new Error("blocked by the page's policy"); } }); // prettier-ignore
    share = pool.open();
    const fatal: string[] = [];
    share.onfatal = ({ message }) => fatal.push(message);
    await pass(0.1);
    expect(fatal).toEqual(["the decoder cannot be started: blocked by the page's policy; load the page again"]);
  });

  test("are not missed while another works", async () => {
    open(2);
    await pass(0.1);
    workers.startMs = 1e9;
    workers.workers[0].crash();
    for (let k = 0; k < 3; k++) workers.workers.at(-1)!.crash();
    const fatal: string[] = [];
    share.onfatal = ({ message }) => fatal.push(message);
    submit(0);
    await pass(1);
    expect(fatal).toEqual([]);
    expect(kinds()).toEqual({ 0: "decoded" });
  });
});

test("a pool shared by two files keeps them apart, and forgets one that leaves", async () => {
  open(1);
  const other = pool.open();
  expect(other.file).not.toBe(share.file);
  submit(0);
  submit(1, 0, 0, other);
  await pass(1);
  expect(outcomes.get(1)).toMatchObject({ kind: "failed", missingState: true });
  share.close();
  expect(workers.workers[0].forgotten).toEqual([share.file]);
  submit(2, 2, null, other);
  await pass(1);
  expect(outcomes.get(2)).toMatchObject({ kind: "decoded" });
});

test("a pool shared by two files gives them turns", async () => {
  open(1);
  const other = pool.open();
  for (let chunk = 0; chunk < 4; chunk++) submit(chunk);
  for (let chunk = 10; chunk < 14; chunk++) submit(chunk, chunk, null, other);
  await pass(2);
  expect(workers.chunks).toEqual([0, 10, 1, 11, 2, 12, 3, 13]);
});

test("a share that has left hears nothing of what was being done for it", async () => {
  open(1);
  submit(0);
  await pass(0.01);
  share.close();
  await pass(1);
  expect(outcomes.size).toBe(0);
});

test("a pool has one worker at least, four at most, and one core left if it may choose", () => {
  for (const [cores, size] of [[1, 1], [2, 1], [3, 2], [5, 4], [64, 4]]) {
    vi.stubGlobal("navigator", { hardwareConcurrency: cores });
    const { create, core } = workers.setup();
    pool = new WorkerPool({ create, core });
    expect(pool.size).toBe(size);
    vi.unstubAllGlobals();
    pool.dispose();
  }
});
