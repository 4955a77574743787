// A web server for one file, honest unless told otherwise.

import { createServer } from "node:http";
import type { IncomingHttpHeaders, IncomingMessage, Server, ServerResponse } from "node:http";
import type { AddressInfo } from "node:net";

export interface Asked {
  readonly from: number;
  readonly to: number; // behind the last byte
  readonly isRange: boolean;
  readonly headers: IncomingHttpHeaders;
}

export type Respond = (response: ServerResponse, asked: Asked, count: number) => Promise<void> | void;

export class FileServer {
  readonly asked: Asked[] = [];
  /** Answers instead of the honest way; gets the number of requests before this one. */
  respond: Respond | null = null;
  /** Of connections whose client went before the end. */
  cut = 0;
  readonly bytes: Uint8Array;
  readonly #server: Server;
  #port = 0;

  private constructor(bytes: Uint8Array) {
    this.bytes = bytes;
    this.#server = createServer((request, response) => void this.#answer(request, response));
  }

  static async of(bytes: Uint8Array): Promise<FileServer> {
    const server = new FileServer(bytes);
    await new Promise<void>((resolve) => server.#server.listen(0, "127.0.0.1", resolve));
    server.#port = (server.#server.address() as AddressInfo).port;
    return server;
  }

  get url(): string {
    return `http://127.0.0.1:${this.#port}/file.reel`;
  }

  async close(): Promise<void> {
    this.#server.closeAllConnections();
    await new Promise((resolve) => this.#server.close(resolve));
  }

  /** The right answer to a range: 206, 416, or 200 to a request without. */
  begin(response: ServerResponse, asked: Asked): Uint8Array {
    const size = this.bytes.length;
    if (asked.isRange && asked.from >= size) {
      response.writeHead(416, { "Content-Range": `bytes */${size}` });
      return new Uint8Array(0);
    }
    const body = this.bytes.subarray(asked.from, asked.to);
    const range = { "Content-Range": `bytes ${asked.from}-${asked.from + body.length - 1}/${size}` };
    const headers = { "Content-Length": body.length, "Content-Type": "application/octet-stream", ETag: '"one"' };
    response.writeHead(asked.isRange ? 206 : 200, { ...headers, ...(asked.isRange ? range : {}) });
    return body;
  }

  async #answer(request: IncomingMessage, response: ServerResponse): Promise<void> {
    const [, from, last] = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? "") ?? [];
    const to = last ? Math.min(Number(last) + 1, this.bytes.length) : this.bytes.length;
    const asked = { from: Number(from ?? 0), to, isRange: from !== undefined, headers: request.headers };
    const count = this.asked.push(asked) - 1;
    response.on("close", () => {
      if (!response.writableFinished) this.cut++;
    });
    if (this.respond) await this.respond(response, asked, count);
    else response.end(this.begin(response, asked));
  }
}

const LATE = 0.1; // s: what a busy machine was late to send is made up for, what nobody asked for is not

/** Sends bytes at a rate, whatever the number of connections; ends with them. Bytes a second. */
export class Throttle {
  readonly bytesPerSecond: number;
  readonly #begun = performance.now();
  #sent = 0;

  constructor(bytesPerSecond: number) {
    this.bytesPerSecond = bytesPerSecond;
  }

  async send(response: ServerResponse, body: Uint8Array): Promise<void> {
    let at = 0;
    while (at < body.length && !response.destroyed) {
      const now = performance.now();
      this.#sent = Math.max(this.#sent, ((now - this.#begun) / 1000 - LATE) * this.bytesPerSecond);
      const allowed = Math.floor(((now - this.#begun) / 1000) * this.bytesPerSecond - this.#sent);
      if (allowed > 0) {
        const piece = body.subarray(at, at + allowed);
        response.write(piece);
        at += piece.length;
        this.#sent += piece.length;
      }
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
    response.end();
  }
}

/** Bytes that differ from place to place. */
export function noise(length: number, seed = 1): Uint8Array {
  let state = seed;
  return Uint8Array.from({ length }, () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state >>> 24;
  });
}
