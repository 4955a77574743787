import { afterEach, beforeEach, describe, expect, test } from "vitest";

import { SourceError } from "../src/errors.ts";
import { HttpSource } from "../src/http_source.ts";
import { readBytes } from "../src/source.ts";
import { FileServer, noise } from "./server.ts";
import type { Respond } from "./server.ts";

const SIZE = 300_000;
const FAST = { retryMs: 5 };
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
    expect(warnings[0]).toMatch(/the connection was cut; trying again in 0.005 s/);
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
    expect(warnings.map((text) => /again in (.*) s/.exec(text)?.[1])).toEqual(["0.005", "0.01", "0.02"]);
  });

  test("and a server that says 503 for ever is given up", async () => {
    server.respond = (response) => void response.writeHead(503).end();
    expect((await failure(0, 10)).message).toMatch(/answers 503, tried 9 times/);
    expect(server.asked).toHaveLength(9);
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
    source = new HttpSource(server.url, { retryMs: 5, silenceMs: 60 });
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

describe("a server that lies or refuses", () => {
  test.each([
    [404, /not found \(404\), check the address/],
    [410, /not found \(410\)/],
    [403, /access refused \(403\)/],
    [401, /access refused \(401\)/],
    [400, /answers 400/],
  ])("with %i is asked once", async (status, message) => {
    server.respond = (response) => void response.writeHead(status).end();
    expect((await failure(0, 10)).message).toMatch(message);
    expect(server.asked).toHaveLength(1);
    expect(warnings).toEqual([]);
  });

  test.each([
    ["another range", "bytes 20-29/300000"],
    ["a longer range", "bytes 10-29/300000"],
    ["a range that is none", "bytes 10-9/300000"],
    ["a range behind the end", "bytes 10-19/15"],
    ["no range", "10 bytes"],
    ["a number that is none", "bytes 10-0x13/300000"],
  ])("about ranges, giving %s, is refused", async (_, text) => {
    server.respond = (response) => void response.writeHead(206, { "Content-Range": text }).end(noise(10));
    expect((await failure(10, 10)).message).toContain(`asked for bytes 10-19, the server says "${text}"`);
    expect(server.asked).toHaveLength(1);
  });

  test("with a body longer than it says is refused", async () => {
    server.respond = (response) => void response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}` }).end(noise(11));
    expect((await failure(10, 10)).message).toContain("more than the bytes 10-19");
  });

  test("with a body shorter than it says is asked for the rest", async () => {
    server.respond = first(1, (response) => void response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}` }).end(server.bytes.subarray(10, 13)));
    expect(await readBytes(source, 10, 10)).toEqual(server.bytes.slice(10, 20));
    expect(warnings[0]).toContain("ended after 3 of 10 bytes");
  });

  test("with an empty body each time is given up", async () => {
    server.respond = (response) => void response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}` }).end();
    expect((await failure(10, 10)).message).toMatch(/ended after 0 of 10 bytes, tried 9 times/);
  });

  test("with a file that changed in mid-stream is refused", async () => {
    await readBytes(source, 0, 10);
    server.respond = (response) => void response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}`, ETag: '"two"' }).end(noise(10));
    expect((await failure(10, 10)).message).toContain("changed on the server");
  });

  test("may weaken the ETag on the way", async () => {
    await readBytes(source, 0, 10);
    server.respond = (response) => void response.writeHead(206, { "Content-Range": `bytes 10-19/${SIZE}`, ETag: 'W/"one"' }).end(noise(10));
    expect(await readBytes(source, 10, 10)).toEqual(noise(10));
  });

  test("with a file of another size is refused", async () => {
    await readBytes(source, 0, 10);
    server.respond = (response) => void response.writeHead(206, { "Content-Range": "bytes 10-19/299999" }).end(noise(10));
    expect((await failure(10, 10)).message).toContain("the file has 299999 bytes and had 300000 before");
  });

  test("with a whole file of another size is refused", async () => {
    await readBytes(source, 0, 10);
    server.respond = (response) => void response.writeHead(200, { "Content-Length": 5 }).end(noise(5));
    expect((await failure(10, 10)).message).toContain("the file has 5 bytes and had 300000 before");
  });

  test("that has nothing of a range within the file is refused", async () => {
    server.respond = (response) => void response.writeHead(416, { "Content-Range": `bytes */${SIZE}` }).end();
    expect((await failure(10, 10)).message).toContain("(416)");
    expect(server.asked).toHaveLength(1);
  });

  test("that has an empty file gives no bytes", async () => {
    server.respond = (response) => void response.writeHead(416, { "Content-Range": "bytes */0" }).end();
    expect(await readBytes(source, 0, 100)).toHaveLength(0);
    expect(source.size).toBe(0);
  });

  test.each([200, 206])("with a web page and a status %i is refused", async (status) => {
    const headers = { "Content-Type": "text/html; charset=utf-8", "Content-Range": `bytes 0-9/${SIZE}` };
    server.respond = (response) => void response.writeHead(status, headers).end("<!doctype html>");
    expect((await failure(0, 10)).message).toContain("a web page (text/html), not the file");
  });

  test("by compressing ranges is refused, by compressing the whole not", async () => {
    const { gzipSync } = await import("node:zlib");
    const range = { "Content-Range": `bytes 0-9/${SIZE}`, "Content-Encoding": "gzip" };
    server.respond = (response) => void response.writeHead(206, range).end(gzipSync(server.bytes.subarray(0, 10)));
    expect((await failure(0, 10)).message).toContain("compresses ranges (gzip)");
    const body = gzipSync(server.bytes);
    server.respond = (response) => void response.writeHead(200, { "Content-Encoding": "gzip", "Content-Length": body.length }).end(body);
    source = new HttpSource(server.url, FAST);
    expect(Buffer.compare(await readBytes(source, 10, SIZE), server.bytes.slice(10))).toBe(0);
    expect(source.size).toBe(SIZE);
  });

  test("after a server that ignored ranges: all readers hear of it", async () => {
    server.respond = (response, _, count) => {
      response.writeHead(count === 0 ? 200 : 404, count === 0 ? { "Content-Length": SIZE } : {});
      if (count > 0) response.end();
      else response.write(server.bytes.subarray(0, 1000), () => response.destroy());
    };
    expect(await readBytes(source, 0, 1000)).toEqual(server.bytes.slice(0, 1000));
    const errors = await Promise.all([failure(2000, 10), failure(SIZE - 10, 10)]);
    expect(errors.map((error) => /\d{3}\)/.exec(error.message)?.[0])).toEqual(["404)", "404)"]);
    expect(await readBytes(source, 0, 1000)).toEqual(server.bytes.slice(0, 1000));
  });
});

test("two reads at once that find out that ranges are ignored share one stream", async () => {
  server.respond = ignoresRange;
  const [a, b] = await Promise.all([readBytes(source, 0, 10), readBytes(source, 5000, 10)]);
  expect([a, b]).toEqual([server.bytes.slice(0, 10), server.bytes.slice(5000, 5010)]);
  await readBytes(source, 100, SIZE);
  expect(server.asked).toHaveLength(2);
});
