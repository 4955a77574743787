// A file on a web server.

import type { Source, SourceWatch, Take } from "./source.ts";

export class HttpSource implements Source {
  readonly url: string;
  readonly size: number | null = null;
  readonly isSelective = true;
  readonly bandwidth = 0;
  watch: SourceWatch | null = null;

  constructor(url: string) {
    this.url = url;
  }

  async read(offset: number, length: number, take: Take, signal?: AbortSignal): Promise<void> {
    void offset, length, take, signal;
    throw new Error("not there yet");
  }

  expect(size: number): void {
    void size;
  }

  close(): void {}
}
