// One request to a web server: asked, watched and counted while its body is read.

import type { Bandwidth, Transfer } from "./bandwidth.ts";
import { Lost } from "./http_answer.ts";

export interface RequestOptions {
  readonly url: string;
  readonly credentials: RequestCredentials;
  readonly silenceMs: number;
}

/** An answer whose body is still to be read. It must be closed. */
export class Answer {
  #response: Response | null = null;
  readonly #controller = new AbortController();
  readonly #transfer: Transfer;
  readonly #silenceMs: number;
  readonly #abort = (): void => this.#controller.abort();
  #signals: AbortSignal[];
  #timer: ReturnType<typeof setTimeout> | undefined;
  #wasSilent = false;

  private constructor(transfer: Transfer, silenceMs: number, signals: AbortSignal[]) {
    this.#transfer = transfer;
    this.#silenceMs = silenceMs;
    this.#signals = signals;
    for (const signal of signals) {
      if (signal.aborted) this.#abort();
      signal.addEventListener("abort", this.#abort);
    }
    this.#listen();
  }

  /**
   * Asks for bytes `from` up to `end`; for the whole file where `from` is 0 and `end` is null. Throws Lost.
   *
   * Past the browser's cache: Chromium's asks the server twice for ranges of one file that are fetched at once.
   */
  static async to(options: RequestOptions, range: readonly [number, number | null], measured: Bandwidth, signals: AbortSignal[]): Promise<Answer> {
    const { url, credentials } = options;
    const answer = new Answer(measured.begin(performance.now()), options.silenceMs, signals);
    const [from, end] = range;
    const headers: HeadersInit = from === 0 && end === null ? {} : { Range: `bytes=${from}-${end === null ? "" : end - 1}` };
    try {
      answer.#response = await fetch(url, { headers, credentials, cache: "no-store", signal: answer.#controller.signal });
      answer.#transfer.answered(performance.now());
      return answer;
    } catch (error) {
      answer.close();
      throw new Lost(answer.#wasSilent ? "the server does not answer" : "no connection", { cause: error });
    }
  }

  get response(): Response {
    return this.#response!;
  }

  /** Pieces of the body as they come. Throws Lost where the connection is cut or nothing comes for long. */
  async *body(): AsyncGenerator<Uint8Array> {
    const reader = this.response.body?.getReader();
    for (;;) {
      let piece: ReadableStreamReadResult<Uint8Array> | undefined;
      try {
        piece = await reader?.read();
      } catch (error) {
        throw new Lost(this.#wasSilent ? "no more bytes come" : "the connection was cut", { cause: error });
      }
      if (piece === undefined || piece.done) return;
      this.#listen();
      this.#transfer.add(piece.value.length, performance.now());
      yield piece.value;
    }
  }

  /** From now on this signal does not end it. */
  outlive(signal: AbortSignal): void {
    signal.removeEventListener("abort", this.#abort);
    this.#signals = this.#signals.filter((other) => other !== signal);
  }

  /** Ends it, read or not: an unread body would hold a connection. */
  close(): void {
    clearTimeout(this.#timer);
    for (const signal of this.#signals) signal.removeEventListener("abort", this.#abort);
    this.#transfer.end(performance.now());
    this.#abort();
  }

  #listen(): void {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      this.#wasSilent = true;
      this.#abort();
    }, this.#silenceMs);
  }
}

/** Waits; rejects with the reason of the first of these signals that is aborted meanwhile. */
export function pause(ms: number, signals: readonly AbortSignal[]): Promise<void> {
  return new Promise((resolve, reject) => {
    const settle = (): void => {
      clearTimeout(timer);
      for (const signal of signals) signal.removeEventListener("abort", settle);
      const aborted = signals.find((signal) => signal.aborted);
      if (aborted) reject(aborted.reason);
      else resolve();
    };
    const timer = setTimeout(settle, ms);
    for (const signal of signals) signal.addEventListener("abort", settle);
    if (signals.some((signal) => signal.aborted)) settle();
  });
}
