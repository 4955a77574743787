import { afterEach, beforeEach, describe, expect, test } from "vitest";

import { SourceError } from "../src/errors.ts";
import { HttpSource } from "../src/net/http_source.ts";
import { readBytes } from "../src/net/source.ts";
import { FileServer, noise } from "./server.ts";
import type { Respond } from "./server.ts";

const SIZE = 300_000;
const FAST = { retryMs: 2 };
let server: FileServer;
let source: HttpSource;
let warnings: string[];

beforeEach(async () => {
  server = await FileServer.of(noise(SIZE));
  source = new HttpSource(server.url, FAST);
  warnings = [];
  source.watch = { warn: (error) => warnings.push(error.message), progress: () => {} };
});

afterEach(async () => {
  source.close();
  await server.close();
});

/** The first `count` requests answered so, the others honestly. */
function first(count: number, respond: Respond): Respond {
  return (response, asked, number) => {
    if (number < count) return respond(response, asked, number);
    response.end(server.begin(response, asked));
  };
}

const ignoresRange: Respond = (response) => {
  response.writeHead(200, { "Content-Length": SIZE });
  response.end(server.bytes);
};

async function failure(offset: number, length: number): Promise<Error> {
  const error: unknown = await readBytes(source, offset, length).then(
    () => new Error("nothing failed"),
    (reason: unknown) => reason,
  );
  expect(error).toBeInstanceOf(SourceError);
  expect((error as Error).message).toContain(server.url);
  expect((error as Error).message).not.toContain("\n");
  return error as Error;
}

describe("a server that knows ranges", () => {
  test("gives the bytes asked for, and the size of the file with the first of them", async () => {
    expect(source.size).toBeNull();
    for (const [offset, length] of [[0, 1], [0, 16384], [1000, 7], [SIZE - 1, 1], [SIZE - 10, 10]]) {
      expect(await readBytes(source, offset, length)).toEqual(server.bytes.slice(offset, offset + length));
      expect(source.size).toBe(SIZE);
    }
    expect(server.asked).toHaveLength(5);
    expect(source.isSelective).toBe(true);
    expect(server.asked[1].headers).toMatchObject({ range: "bytes=0-16383", "cache-control": "no-cache" });
    expect(source.bandwidth).toBeGreaterThan(0);
  });

  test("gives fewer bytes where the file ends, and none behind it", async () => {
    expect(await readBytes(source, SIZE - 5, 100)).toEqual(server.bytes.slice(SIZE - 5));
    expect(await readBytes(source, SIZE, 10)).toHaveLength(0);
    expect(server.asked).toHaveLength(1);
  });

  test("is left when the reader goes, in mid-stream", async () => {
    const gone = new AbortController();
    let release = (): void => {};
    server.respond = (response, asked) => {
      response.write(server.begin(response, asked).subarray(0, 1000));
      return new Promise((resolve) => (release = resolve));
    };
    const read = source.read(0, SIZE, () => gone.abort(new Error("seek")), gone.signal);
    await expect(read).rejects.toThrow("seek");
    await expect.poll(() => server.cut).toBe(1);
    release();
  });

  test("is not asked at all by a reader that is gone already", async () => {
    await expect(readBytes(source, 0, 10, AbortSignal.abort(new Error("gone")))).rejects.toThrow("gone");
    expect(server.asked).toHaveLength(0);
  });

  test("is asked again for the rest where it gives a shorter range than asked for", async () => {
    server.respond = (response, asked) => void response.end(server.begin(response, { ...asked, to: Math.min(asked.to, asked.from + 100) }));
    expect(await readBytes(source, 50, 250)).toEqual(server.bytes.slice(50, 300));
    expect(server.asked.map(({ from }) => from)).toEqual([50, 150, 250]);
    expect(warnings).toEqual([]);
  });

  test("may hide Content-Range, as it does from other origins; then a 416 tells where the file ends", async () => {
    const cors: Respond = (response, asked) => {
      const body = server.bytes.subarray(asked.from, asked.to);
      response.writeHead(asked.from < SIZE ? 206 : 416, { "Content-Length": body.length });
      response.end(body);
    };
    server.respond = cors;
    expect(await readBytes(source, 0, 100)).toEqual(server.bytes.slice(0, 100));
    expect(source.size).toBeNull();
    expect(await readBytes(source, SIZE - 10, 50)).toEqual(server.bytes.slice(SIZE - 10));
    expect(source.size).toBe(SIZE);
  });
});

describe("a server that ignores ranges", () => {
  test("is read once, and ranges come from what has arrived, as it arrives", async () => {
    let release = (): void => {};
    server.respond = async (response) => {
      response.writeHead(200, { "Content-Length": SIZE });
      response.write(server.bytes.subarray(0, SIZE / 2));
      await new Promise<void>((resolve) => (release = resolve));
      response.end(server.bytes.subarray(SIZE / 2));
    };
    expect(await readBytes(source, 100, 1000)).toEqual(server.bytes.slice(100, 1100));
    expect(source.isSelective).toBe(false);
    expect(source.size).toBe(SIZE);
    let isThere = false;
    const late = readBytes(source, SIZE - 50, 100).finally(() => (isThere = true));
    expect(await readBytes(source, SIZE / 2 - 10, 10)).toEqual(server.bytes.slice(SIZE / 2 - 10, SIZE / 2));
    expect(isThere).toBe(false);
    release();
    expect(await late).toEqual(server.bytes.slice(SIZE - 50));
    expect(server.asked).toHaveLength(1);
  });

  test("goes on arriving when the reader that found it out is gone", async () => {
    let release = (): void => {};
    server.respond = async (response) => {
      response.writeHead(200);
      response.write(server.bytes.subarray(0, 10));
      await new Promise<void>((resolve) => (release = resolve));
      response.end(server.bytes.subarray(10));
    };
    const gone = new AbortController();
    await expect(source.read(0, SIZE, () => gone.abort(new Error("seek")), gone.signal)).rejects.toThrow("seek");
    const rest = readBytes(source, SIZE - 10, 10);
    release();
    expect(await rest).toEqual(server.bytes.slice(SIZE - 10));
    expect(server.asked).toHaveLength(1);
    await expect.poll(() => source.size).toBe(SIZE);
  });

  test("is asked for the rest after a cut, and what it sends again is skipped", async () => {
    server.respond = (response, _, count) => {
      response.writeHead(200, { "Content-Length": SIZE });
      if (count > 1) return void response.end(server.bytes);
      response.write(server.bytes.subarray(0, 100_000 * (count + 1)), () => response.destroy());
    };
    expect(Buffer.compare(await readBytes(source, 0, SIZE), server.bytes)).toBe(0);
    expect(server.asked).toHaveLength(3);
    expect(warnings).toHaveLength(2);
  });

  test("that knows them after a cut gives the rest alone", async () => {
    server.respond = (response, asked, count) => {
      if (count > 0) return void response.end(server.begin(response, asked));
      response.writeHead(200, { "Content-Length": SIZE });
      response.write(server.bytes.subarray(0, 100_000), () => response.destroy());
    };
    expect(Buffer.compare(await readBytes(source, 0, SIZE), server.bytes)).toBe(0);
    expect(server.asked).toHaveLength(2);
    expect(server.asked[1].from).toBe(100_000);
  });

  test("and never ends is left at the size that the head tells", async () => {
    server.respond = async (response) => {
      response.writeHead(200);
      while (!response.destroyed) {
        response.write(server.bytes.subarray(0, 10_000));
        await new Promise((resolve) => setTimeout(resolve, 1));
      }
    };
    expect(await readBytes(source, 0, 14)).toHaveLength(14);
    source.expect(50_000);
    const error = await failure(0, SIZE);
    expect(error.message).toContain("more than the 50000 bytes");
    await expect.poll(() => server.cut).toBe(1);
  });
});

describe("a bad connection", () => {
  test("that is cut in mid-stream is taken up where it was cut, with a warning", async () => {
    server.respond = first(2, (response, asked) => {
      response.write(server.begin(response, asked).subarray(0, 1000), () => response.destroy());
    });
    expect(await readBytes(source, 500, 5000)).toEqual(server.bytes.slice(500, 5500));
    expect(server.asked.map(({ from }) => from)).toEqual([500, 1500, 2500]);
    expect(warnings).toHaveLength(2);
    expect(warnings[0]).toMatch(/the connection was cut; trying again in 0.002 s/);
  });

  test("may fail for ever if every answer brings a byte", async () => {
    server.respond = (response, asked) => {
      response.write(server.begin(response, asked).subarray(0, 1), () => response.destroy());
    };
    expect(await readBytes(source, 0, 20)).toEqual(server.bytes.slice(0, 20));
    expect(server.asked).toHaveLength(20);
  });

  test("and a server that says 500 three times is asked a fourth time, later each time", async () => {
    server.respond = first(3, (response) => void response.writeHead(500).end("sorry"));
    expect(await readBytes(source, 0, 10)).toEqual(server.bytes.slice(0, 10));
    expect(server.asked).toHaveLength(4);
    expect(warnings.map((text) => /again in (.*) s/.exec(text)?.[1])).toEqual(["0.002", "0.004", "0.008"]);
  });

  test("and a server that says 503 for ever is given up", async () => {
    server.respond = (response) => void response.writeHead(503).end();
    expect((await failure(0, 10)).message).toMatch(/answers 503, tried 12 times/);
    expect(server.asked).toHaveLength(12);
  });

  test("that was never there is given up sooner, and names CORS", async () => {
    await server.close();
    expect((await failure(0, 10)).message).toMatch(/no connection, tried 4 times: .*CORS/);
  });

  test("that comes back is used again", async () => {
    const { port } = new URL(server.url);
    const read = readBytes(source, 0, 10);
    await expect(read).resolves.toHaveLength(10);
    await server.close();
    const again = readBytes(source, 10, 10);
    await expect.poll(() => warnings.length).toBeGreaterThan(1);
    const { createServer } = await import("node:http");
    const second = createServer((_, response) => {
      response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}`, "Content-Length": 10, ETag: '"one"' });
      response.end(server.bytes.subarray(10, 20));
    });
    await new Promise<void>((resolve) => second.listen(Number(port), "127.0.0.1", resolve));
    expect(await again).toEqual(server.bytes.slice(10, 20));
    second.closeAllConnections();
    second.close();
  });

  test("that falls silent is cut and tried again", async () => {
    source = new HttpSource(server.url, { retryMs: 2, silenceMs: 400 });
    source.watch = { warn: (error) => warnings.push(error.message), progress: () => {} };
    server.respond = (response, asked, count) => {
      const body = server.begin(response, asked);
      if (count > 1) response.end(body);
      else if (count === 1) response.write(body.subarray(0, 10));
      else response.flushHeaders();
    };
    expect(await readBytes(source, 0, 100)).toEqual(server.bytes.slice(0, 100));
    expect(server.asked.map(({ from }) => from)).toEqual([0, 0, 10]);
    expect(warnings.join()).toContain("no more bytes come");
  });

  test("is not waited for by a reader that goes", async () => {
    server.respond = (response) => void response.writeHead(500).end();
    source = new HttpSource(server.url, { retryMs: 60_000 });
    const gone = new AbortController();
    const read = readBytes(source, 0, 10, gone.signal);
    await expect.poll(() => server.asked.length).toBe(1);
    gone.abort(new Error("seek"));
    await expect(read).rejects.toThrow("seek");
  });

  test("is not waited for by a source that is closed", async () => {
    server.respond = (response) => void response.writeHead(500).end();
    source = new HttpSource(server.url, { retryMs: 60_000 });
    const read = readBytes(source, 0, 10);
    await expect.poll(() => server.asked.length).toBe(1);
    source.close();
    await expect(read).rejects.toThrow("closed");
  });
});

test("two reads at once that find out that ranges are ignored share one stream", async () => {
  server.respond = ignoresRange;
  const [a, b] = await Promise.all([readBytes(source, 0, 10), readBytes(source, 5000, 10)]);
  expect([a, b]).toEqual([server.bytes.slice(0, 10), server.bytes.slice(5000, 5010)]);
  await readBytes(source, 100, SIZE);
  expect(server.asked).toHaveLength(2);
});
