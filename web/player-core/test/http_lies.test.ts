// Servers that lie or refuse: what is wrong is said, and nothing of it is taken for the file.

import { afterEach, beforeEach, describe, expect, test } from "vitest";

import { SourceError } from "../src/errors.ts";
import { HttpSource } from "../src/net/http_source.ts";
import { Player } from "../src/player.ts";
import { readBytes } from "../src/net/source.ts";
import { FakeWorkers } from "./fake_workers.ts";
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
    expect((await failure(10, 10)).message).toMatch(/ended after 0 of 10 bytes, tried 12 times/);
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

  test("by sending another file without end is left when the player has refused it", async () => {
    server.respond = async (response) => {
      response.writeHead(200);
      while (!response.destroyed) {
        response.write(server.bytes.subarray(0, 20_000));
        await new Promise((resolve) => setTimeout(resolve, 1));
      }
    };
    const player = new Player({ source, workers: new FakeWorkers().setup() });
    await expect(player.load()).rejects.toThrow("not a .reel file");
    await expect.poll(() => server.cut).toBe(1);
    player.dispose();
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
