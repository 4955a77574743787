// Colours of vertices: the same as in Python, of all forms; and what is damaged in them costs no geometry.

import { createHash } from "node:crypto";
import { readdirSync } from "node:fs";

import { beforeAll, describe, expect, test, vi } from "vitest";

import { hasPython, runPython } from "../../test/python.ts";
import { ChunkDecoder, buffersOf } from "../src/decode/chunk_decoder.ts";
import { Video } from "./whole_video.ts";
import type { Core } from "../src/wasm/core.ts";
import { serve } from "../src/decode/worker.ts";
import type { Scope } from "../src/decode/worker.ts";
import { FormatError } from "../src/errors.ts";
import { crc32 } from "../src/format/crc.ts";
import { Form } from "../src/format/layout.gen.ts";
import { Head } from "../src/format/reader.ts";
import type { Chunk } from "../src/format/reader.ts";
import type { Damage, DecodeJob, FromWorker, ToWorker } from "../src/protocol.ts";
import type { Packed, PackedGroup } from "../src/types.ts";
import { CoreStopped } from "../src/wasm/core.ts";
import { jobOf, noDamage } from "./jobs.ts";
import { noise } from "./server.ts";
import { ROOT, coreWasm, nodeCore } from "./tools.ts";

const FOLDER = `${ROOT}/conformance/v1`;
const NAMES = readdirSync(FOLDER).filter((name) => name.endsWith(".reel") && !["cut.reel", "joined.reel"].includes(name)).map((name) => name.slice(0, -5)); // an edit has chunks of another file
const TRIES = 20; // of each chunk
const CUTS = 20; // of each chunk

interface Painted {
  readonly data: Uint8Array<ArrayBuffer>;
  readonly frames: readonly string[]; // SHA-256 of the colours of each
  readonly framesOfOneLayer: readonly string[];
}

let core: Core;
let painted: Record<string, Painted>;
beforeAll(async () => {
  core = await nodeCore();
  if (!hasPython) return;
  const made = JSON.parse(runPython(new URL("colored.py", import.meta.url), ...NAMES.map((name) => `${FOLDER}/${name}.reel`)).toString()) as Record<
    string,
    Omit<Painted, "data"> & { readonly file: string }
  >;
  painted = Object.fromEntries(Object.entries(made).map(([name, { file, ...others }]) => [name, { data: Uint8Array.from(Buffer.from(file, "base64")), ...others }]));
});

const digest = (colors: Uint8Array | undefined): string => createHash("sha256").update(colors ?? new Uint8Array(0)).digest("hex");

/** A job as it comes to a worker, changed by a test. */
function changed(job: DecodeJob, change: (payload: Uint8Array) => Uint8Array): DecodeJob {
  const companions = job.companions.map((companion) => {
    const payload = change(companion.payload.slice());
    return { ...companion, payload, ranges: [{ size: payload.length, crc: crc32(payload) }] };
  });
  return { ...job, companions };
}

const decodedChunks = (head: Head): Chunk[] => head.chunks.filter(({ kind }) => kind === "group" || kind === "static");

describe.skipIf(!hasPython).each(NAMES)("%s", (name) => {
  test("has the colours that Python decodes, played to and fro", () => {
    const { data, frames, framesOfOneLayer } = painted[name];
    const [all, one] = [new Video(core, data), new Video(core, data, 1)];
    expect(frames.map((_, frame) => digest(all.frame(frame).colors))).toEqual(frames);
    expect(framesOfOneLayer.map((_, frame) => digest(one.frame(frame).colors))).toEqual(framesOfOneLayer);
    const again = new Video(core, data);
    for (let frame = frames.length - 1; frame >= 0; frame--) expect(digest(again.frame(frame).colors)).toBe(frames[frame]);
    expect(all.head.info.hasColors).toBe(name !== "empty");
  });

  test("is packed with its colours in the order of its vertices, and they are handed over", () => {
    const { data } = painted[name];
    const video = new Video(core, data);
    const decoder = new ChunkDecoder(core);
    for (const chunk of decodedChunks(video.head)) {
      const packed = decoder.decode(jobOf(video.head, chunk, data), noDamage)!;
      if (packed.colors === null) {
        expect([Form.EMPTY]).toContain(chunk.form);
        continue;
      }
      expect(packed.colors.length).toBe(packed.texels.length);
      expect(buffersOf(packed)).toContain(packed.colors.buffer);
      expect(packed.bytes).toBe(chunk.size + video.head.companionsOf(chunk)[0].size);
      if (packed.kind === "group") expectFrames(video, packed);
    }
  });

  test("with colours that are changed is refused in words or decoded, its geometry all the same", () => {
    const { data } = painted[name];
    const { head } = new Video(core, data);
    const decoder = new ChunkDecoder(core);
    for (const chunk of decodedChunks(head)) {
      const job = jobOf(head, chunk, data);
      if (job.companions.length === 0) continue;
      const sound = decoder.decode(jobOf(head, chunk, data), noDamage)!;
      for (let seed = 1; seed <= TRIES; seed++) {
        const damage: Damage[] = [];
        const packed = decoder.decode(changed(job, (payload) => spoiled(payload, seed)), (found) => damage.push(found))!;
        expect(geometryOf(packed)).toBe(geometryOf(sound));
        if (damage.length > 0 && chunk.kind === "group") expect(packed.colors).toBeNull();
        for (const found of damage) expect(found).toEqual({ chunk: head.companionsOf(chunk)[0].number, message: expect.stringMatching(/^[^\n]+$/) });
      }
      const whole = job.companions[0].payload.length;
      for (let size = 0; size < whole; size += Math.ceil(whole / CUTS)) {
        const damage: Damage[] = [];
        decoder.decode(changed(job, (payload) => payload.slice(0, size)), (found) => damage.push(found));
        expect(damage, `${size} bytes of chunk ${chunk.number}`).toHaveLength(1);
      }
      expect(decoder.decode(jobOf(head, chunk, data), noDamage)!.colors).toEqual(sound.colors); // so that the next has its state
    }
  });
});

/** The colours of a group, frame by frame, are those of the decoder. */
function expectFrames(video: Video, packed: PackedGroup): void {
  const { frameCount, vertexCount, firstFrame } = packed;
  const texel = (number: number): readonly number[] => [...packed.colors!.subarray(4 * number, 4 * number + 3)];
  let alone = frameCount * vertexCount;
  for (let t = 0; t < frameCount; t++) {
    const tracks = video.head.tracks.length > 1 || video.head.staticOfFrame(firstFrame + t) !== null;
    if (tracks) return; // the frame has more than this group
    const colors = video.frame(firstFrame + t).colors ?? new Uint8Array(0);
    for (let v = 0; v < colors.length / 3; v++) {
      expect(texel(v < vertexCount ? t * vertexCount + v : alone++)).toEqual([...colors.subarray(3 * v, 3 * v + 3)]);
    }
  }
}

function geometryOf({ texels, faces }: Packed): string {
  const hash = createHash("sha256");
  for (const array of [texels, faces]) hash.update(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  return hash.digest("hex");
}

/** With one to four bytes changed, most of them near the start. */
function spoiled(payload: Uint8Array, seed: number): Uint8Array {
  const random = noise(9, seed);
  for (let k = 0; k < 1 + (random[0] & 3); k++) {
    const [where, value] = random.subarray(1 + 2 * k, 3 + 2 * k);
    payload[where % Math.min(payload.length, value < 200 ? 40 : payload.length)] ^= 1 + (value & 0x7f);
  }
  return payload;
}

describe.skipIf(!hasPython)("a group with fewer layers", () => {
  test("has the colours of its own vertices, also where the one before has more", () => {
    const { data } = painted["layers"];
    const { head } = new Video(core, data);
    const decoder = new ChunkDecoder(core);
    const fewer = (chunk: Chunk, layers: number): DecodeJob => {
      const job = jobOf(head, chunk, data);
      const cut = <T extends Pick<DecodeJob, "payload" | "ranges">>(part: T): T => {
        const ranges = part.ranges.slice(0, layers + 1);
        return { ...part, ranges, payload: part.payload.slice(0, ranges.reduce((sum, { size }) => sum + size, 0)) };
      };
      return { ...cut(job), companions: job.companions.map(cut), layers };
    };
    const [first, second] = decodedChunks(head);
    const one = new Video(core, data, 1);
    const ofOne = [...one.frame(second.firstFrame).colors!];
    for (const before of [fewer(first, 1), jobOf(head, first, data)]) {
      decoder.decode(before, noDamage);
      const packed = decoder.decode(fewer(second, 1), noDamage)!;
      const shown = [...packed.colors!.subarray(0, (4 * ofOne.length) / 3)].filter((_, k) => k % 4 < 3);
      expect(shown).toEqual(ofOne);
    }
  });
});

describe.skipIf(!hasPython)("colours", () => {
  test("of another form or without chroma are refused", () => {
    const { data } = painted["draco"];
    const [chunk] = Head.parse(data).chunks;
    const payload = data.slice(chunk.offset, chunk.offset + chunk.size);
    const group = core.open({ payload, frames: chunk.frameCount, layers: null, previous: null, isShown: true, scale: 1, origin: [0, 0, 0] });
    const colored = (...bytes: number[]) => (): void => core.dress(group, "colors", Uint8Array.from(bytes));
    expect(colored(6, 0, 0)).toThrow(/multiplied by 0/);
    expect(colored(2, 0, 64)).toThrow(/another form/);
    expect(colored(6, 1, 64)).toThrow(/predicted from those of a group which is not at hand/);
    expect(colored(6)).toThrow(FormatError);
    expect(core.show(group, 0).colors).toHaveLength(0);
    core.close(group);
  });

  test("that stop the core are told as damaged, and the chunk may come again", async () => {
    const { data } = painted["layers"];
    const { head } = new Video(core, data);
    const told: FromWorker[] = [];
    const scope: Scope = { onmessage: null, postMessage: (message) => told.push(message) };
    serve(scope);
    const send = (message: ToWorker): void => scope.onmessage!({ data: message } as MessageEvent<ToWorker>);
    const decode = vi.spyOn(ChunkDecoder.prototype, "decode").mockImplementationOnce((_, damage) => {
      damage({ chunk: 1, message: "no memory" });
      throw new CoreStopped("no memory");
    });
    send({ type: "start", core: coreWasm() });
    const job = jobOf(head, head.chunks[0], data);
    send({ type: "decode", id: 1, job });
    send({ type: "decode", id: 2, job: { ...job, companions: [] } });
    await expect.poll(() => told.length).toBe(3);
    decode.mockRestore();
    expect(told[1]).toMatchObject({ type: "failed", id: 1, missingState: true, damage: [{ chunk: 1 }] });
    expect(told[2]).toMatchObject({ type: "decoded", id: 2, packed: { chunk: 0, colors: null }, damage: [] });
  });
});
