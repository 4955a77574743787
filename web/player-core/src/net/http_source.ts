// A file on a web server, by ranges; from a server that knows none, as one stream.

import { Bandwidth } from "./bandwidth.ts";
import { SourceError } from "../errors.ts";
import { Lost, announcedSize, checkIdentity, checkRange, checkSize, checkStatus, checkUnsatisfiable } from "./http_answer.ts";
import type { Known } from "./http_answer.ts";
import { Answer, pause } from "./http_request.ts";
import type { RequestOptions } from "./http_request.ts";
import type { Source, SourceWatch, Take } from "./source.ts";
import { WholeBody } from "./whole_body.ts";

export interface HttpOptions {
  readonly credentials?: RequestCredentials; // as `fetch` has it; "same-origin" if not given
  readonly retryMs?: number; // before the first new try, doubled with each further one up to 32 times; 250 if not given
  readonly silenceMs?: number; // without a byte before a connection counts as lost; 20 000 if not given
}

const FIRST_TRIES = 4; // of a server that never answered; of another one:
const TRIES = 12; // without a byte between them, a minute

export class HttpSource implements Source {
  readonly url: string;
  watch: SourceWatch | null = null;
  readonly #options: RequestOptions & { readonly retryMs: number };
  readonly #known: Known;
  readonly #measured = new Bandwidth();
  readonly #closed = new AbortController();
  #whole: WholeBody | null = null;
  #expected = Infinity; // bytes, as the head has it
  #reach = 0; // behind the last byte that a range has given
  #hasAnswered = false;

  constructor(url: string | URL, options: HttpOptions = {}) {
    this.url = String(url);
    this.#options = { credentials: "same-origin", retryMs: 250, silenceMs: 20_000, ...options, url: this.url };
    this.#known = { url: this.url, size: null, etag: null };
  }

  get size(): number | null {
    return this.#known.size;
  }

  get isSelective(): boolean {
    return this.#whole === null;
  }

  get bandwidth(): number {
    return this.#measured.bitsPerSecond;
  }

  get latency(): number {
    return this.#measured.latency / 1000;
  }

  expect(size: number): void {
    this.#expected = size;
  }

  close(): void {
    this.#closed.abort(new SourceError(`${this.url}: closed`));
  }

  async read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void> {
    const end = offset + length;
    let at = offset;
    const count = (bytes: Uint8Array, from: number): void => {
      at = from + bytes.length;
      this.#reach = Math.max(this.#reach, at);
      take(bytes, from);
    };
    const attempt = (): Promise<void> => this.#range(at, end, count, signal);
    while (at < Math.min(end, this.size ?? end)) {
      if (this.#whole !== null) return this.#whole.read(at, end, take, signal);
      await this.#persist(attempt, () => at, signal);
    }
  }

  /** Does `attempt` until it succeeds or cannot; `progress` in between gives it new tries. */
  async #persist(attempt: () => Promise<void>, progress: () => number, signal?: AbortSignal): Promise<void> {
    const signals = signal ? [signal, this.#closed.signal] : [this.#closed.signal];
    for (let failures = 1, before = progress(); ; failures++) {
      try {
        return await attempt();
      } catch (error) {
        for (const { aborted, reason } of signals) if (aborted) throw reason;
        if (!(error instanceof Lost)) throw error;
        if (progress() > before) failures = 1;
        before = progress();
        await this.#waitAfter(error, failures, signals);
      }
    }
  }

  async #waitAfter(error: Lost, failures: number, signals: readonly AbortSignal[]): Promise<void> {
    const what = `${this.url}: ${error.message}`;
    if (failures >= (this.#hasAnswered ? TRIES : FIRST_TRIES)) {
      const remedy = this.#hasAnswered ? "check the connection" : "check the address, the connection, and that the server allows this page (CORS)";
      throw new SourceError(`${what}, tried ${failures} times: ${remedy} and load it again`, { cause: error, kind: error.kind });
    }
    const delay = this.#options.retryMs * 2 ** Math.min(failures - 1, 5);
    this.watch?.warn(new SourceError(`${what}; trying again in ${delay / 1000} s`, { cause: error }));
    await pause(delay, signals);
  }

  /** Asks, and checks what any answer is checked for. */
  async #ask(from: number, end: number | null, signal?: AbortSignal): Promise<Answer> {
    const signals = signal ? [signal, this.#closed.signal] : [this.#closed.signal];
    const answer = await Answer.to(this.#options, [from, end], this.#measured, signals);
    this.#hasAnswered = true;
    try {
      checkStatus(answer.response, this.url);
      if (answer.response.status !== 416) checkIdentity(answer.response, this.#known);
      return answer;
    } catch (error) {
      answer.close();
      throw error;
    }
  }

  /** One request for bytes `from` up to `end`. Returns with fewer where the server gave fewer. */
  async #range(from: number, end: number, take: Take, signal?: AbortSignal): Promise<void> {
    const answer = await this.#ask(from, end, signal);
    if (answer.response.status === 200) return this.#switchToWhole(answer, signal);
    try {
      if (answer.response.status === 416) return this.#endsBefore(answer.response, from, end);
      const to = checkRange(answer.response, from, end, this.#known);
      let at = from;
      for await (const bytes of this.#body(answer)) {
        if (at + bytes.length > to) throw new SourceError(`${this.url}: the server sends more than the bytes ${from}-${to - 1} that it says`);
        take(bytes, at);
        at += bytes.length;
      }
      // Shorter than announced is a cut. Where nothing was announced the file may end here; a 416 shows it.
      if (at === from || (at < to && answer.response.headers.has("Content-Range"))) {
        throw new Lost(`the answer ended after ${at - from} of ${to - from} bytes`);
      }
    } finally {
      answer.close();
    }
  }

  async *#body(answer: Answer): AsyncGenerator<Uint8Array> {
    for await (const bytes of answer.body()) {
      this.watch?.progress(bytes.length);
      yield bytes;
    }
  }

  #endsBefore(response: Response, from: number, end: number): void {
    checkUnsatisfiable(response, this.#known);
    if (this.size === null && from > 0 && from === this.#reach) this.#known.size = from; // it had all bytes before this one
    if (this.size !== null && this.size <= from) return;
    throw new SourceError(`${this.url}: the server has no bytes ${from}-${end - 1} (416): the file is not whole, copy it to the server again`);
  }

  /** From here on the file comes as one stream, the body of this answer first. */
  #switchToWhole(first: Answer, signal?: AbortSignal): void {
    if (this.#whole !== null) return first.close();
    if (signal) first.outlive(signal);
    const whole = (this.#whole = new WholeBody());
    let answer: Answer | null = first;
    const attempt = async (): Promise<void> => {
      const next = answer ?? (await this.#ask(whole.length, null));
      answer = null;
      await this.#stream(next, whole).finally(() => next.close());
    };
    const finish = (): void => {
      this.#known.size = whole.length;
      whole.finish();
    };
    this.#persist(attempt, () => whole.length).then(finish, (error: unknown) => whole.fail(error));
  }

  /** The rest of the file. After a cut, what is there already is skipped where the server sends it again. */
  async #stream(answer: Answer, whole: WholeBody): Promise<void> {
    const { response } = answer;
    if (response.status === 416) return;
    const isWhole = response.status === 200;
    const size = isWhole ? announcedSize(response) : null;
    if (size !== null) checkSize(size, this.#known);
    if (!isWhole) checkRange(response, whole.length, this.size ?? Infinity, this.#known);
    let at = isWhole ? 0 : whole.length;
    for await (const bytes of this.#body(answer)) {
      const fresh = bytes.subarray(Math.min(whole.length - at, bytes.length));
      at += bytes.length;
      if (at > this.#expected) throw new SourceError(`${this.url}: more than the ${this.#expected} bytes of the file, copy it to the server again`);
      if (fresh.length > 0) whole.add(fresh);
    }
    if (this.size !== null && at < this.size) throw new Lost(`the answer ended after ${at} of ${this.size} bytes`);
  }
}
