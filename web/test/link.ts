// A slow line between a browser and a server of this machine: so many bits a second down, so long a way, and a way more for each new connection.

import { connect, createServer } from "node:net";
import type { AddressInfo, Socket } from "node:net";

const SLICE = 1460; // bytes of a packet: connections take turns with them

export interface Link {
  readonly origin: string;
  /** Bytes that came down. */
  readonly bytes: number;
  close(): Promise<void>;
}

interface Lane {
  readonly socket: Socket;
  readonly waiting: Buffer[];
  ended: boolean;
}

/** A line to a port of this machine. `milliseconds`: there and back. Up, it is as fast as one likes. */
export async function openLink(port: number, bitsPerSecond: number, milliseconds: number): Promise<Link> {
  const lanes = new Set<Lane>();
  const sockets = new Set<Socket>();
  let [free, sent, running] = [0, 0, false];

  const pump = (): void => {
    running = false;
    const now = performance.now();
    for (let moved = true; moved && free <= now; ) {
      moved = false;
      for (const lane of [...lanes]) {
        const piece = lane.waiting.shift();
        if (piece !== undefined) {
          moved = true;
          sent += piece.length;
          free = Math.max(free, now - 20) + (8000 * piece.length) / bitsPerSecond; // a timer that is late loses nothing
          setTimeout(() => lane.socket.writable && lane.socket.write(piece), milliseconds / 2);
        } else if (lane.ended) {
          lanes.delete(lane);
          setTimeout(() => lane.socket.end(), milliseconds / 2);
        }
      }
    }
    wake();
  };
  const wake = (): void => {
    if (running || ![...lanes].some((lane) => lane.waiting.length > 0 || lane.ended)) return;
    running = true;
    setTimeout(pump, Math.max(0, free - performance.now()));
  };

  const server = createServer((socket) => {
    const far = connect(port, "127.0.0.1");
    const lane: Lane = { socket, waiting: [], ended: false };
    lanes.add(lane);
    const opened = performance.now() + milliseconds; // the handshake
    for (const some of [socket, far]) {
      some.setNoDelay(true);
      sockets.add(some);
      some.on("error", () => some.destroy()).on("close", () => sockets.delete(some));
    }
    socket.on("data", (data) => setTimeout(() => far.writable && far.write(data), milliseconds / 2 + Math.max(0, opened - performance.now())));
    socket.on("close", () => (lanes.delete(lane), far.destroy()));
    far.on("data", (data: Buffer) => {
      for (let at = 0; at < data.length; at += SLICE) lane.waiting.push(data.subarray(at, at + SLICE));
      wake();
    });
    far.on("end", () => {
      lane.ended = true;
      wake();
    });
  });
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  return {
    origin: `http://127.0.0.1:${(server.address() as AddressInfo).port}`,
    get bytes() {
      return sent;
    },
    close: () =>
      new Promise((done) => {
        server.close(() => done());
        for (const socket of sockets) socket.destroy();
      }),
  };
}
