// What kind of error each failure is: programs go by the kind, people by the message.

import { readFileSync } from "node:fs";

import { afterEach, beforeEach, expect, test } from "vitest";

import { FormatError, SourceError } from "../src/errors.ts";
import { HttpSource } from "../src/net/http_source.ts";
import { open } from "../src/net/opening.ts";
import { BytesSource } from "../src/net/source.ts";
import { FileServer } from "./server.ts";
import type { Respond } from "./server.ts";
import { ROOT } from "./tools.ts";

const FILE = new Uint8Array(readFileSync(`${ROOT}/conformance/v1/layers.reel`));
const { signal } = new AbortController();

let server: FileServer;
beforeEach(async () => {
  server = await FileServer.of(FILE);
});
afterEach(() => server.close());

test.each<[SourceError["kind"], string, Respond]>([
  ["missing", "404", (response) => void response.writeHead(404).end()],
  ["refused", "403", (response) => void response.writeHead(403).end()],
  ["failing", "503 each time", (response) => void response.writeHead(503).end()],
  ["unreachable", "no byte", (response) => void response.destroy()],
  ["foreign", "a web page", (response) => void response.writeHead(200, { "Content-Type": "text/html" }).end("<p>Hello")],
  ["unusable", "another range", (response) => void response.writeHead(206, { "Content-Range": "bytes 7-8/9" }).end("xx")],
])("%s: a server that answers with %s", async (kind, _, respond) => {
  server.respond = respond;
  const error: unknown = await open(new HttpSource(server.url, { retryMs: 0.1 }), signal).catch((reason: unknown) => reason);
  expect(error).toBeInstanceOf(SourceError);
  expect(error).toMatchObject({ kind });
});

test.each<[FormatError["kind"], string, (file: Uint8Array) => Uint8Array]>([
  ["foreign", "another signature", (file) => file.fill(0x20, 0, 8)],
  ["newer", "another version", (file) => file.fill(9, 8, 9)],
  ["damaged", "a byte of the head that was changed", (file) => file.fill(0xff, 30, 31)],
  ["damaged", "half of a head", (file) => file.slice(0, 40)],
])("%s: a file with %s", async (kind, _, change) => {
  const error: unknown = await open(new BytesSource(change(FILE.slice())), signal).catch((reason: unknown) => reason);
  expect(error).toBeInstanceOf(FormatError);
  expect(error).toMatchObject({ kind });
});
