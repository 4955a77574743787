// Checks of a web server's answers.

import { SourceError } from "../errors.ts";

/** The connection failed, or the server for now: it may be tried again. */
export class Lost extends Error {
  override name = "Lost";

  constructor(
    message: string,
    options?: ErrorOptions,
    readonly kind: "unreachable" | "failing" = "unreachable",
  ) {
    super(message, options);
  }
}

/** Facts about the file from the answers so far. */
export interface Known {
  readonly url: string;
  size: number | null;
  etag: string | null;
}

/** Throws where an answer has no bytes of the file: Lost if it may be tried again, SourceError if not. */
export function checkStatus(response: Response, url: string): void {
  const status = response.status;
  if (status === 200 || status === 206 || status === 416) return;
  if (status >= 500 || status === 408 || status === 429) throw new Lost(`the server answers ${status}`, {}, "failing");
  if (status === 404 || status === 410) throw new SourceError(`${url}: not found (${status}), check the address`, { kind: "missing" });
  if (status === 401 || status === 403) throw new SourceError(`${url}: access refused (${status}), ask for permission`, { kind: "refused" });
  throw new SourceError(`${url}: the server answers ${status}, not the file`);
}

/** Throws where the answer is another thing than the file that was read before. */
export function checkIdentity(response: Response, known: Known): void {
  const type = response.headers.get("Content-Type")?.split(";")[0].trim().toLowerCase();
  if (type === "text/html" || type === "application/xhtml+xml") {
    throw new SourceError(`${known.url}: the server sends a web page (${type}), not the file: check the address`, { kind: "foreign" });
  }
  const etag = response.headers.get("ETag")?.replace(/^W\//, "") ?? null; // null, too, where another origin hides it
  if (etag !== null && known.etag !== null && etag !== known.etag) {
    throw new SourceError(`${known.url}: the file was changed on the server while it was read, load it again`);
  }
  known.etag ??= etag;
}

/** End of the part that a 206 holds of the requested range; both must start at the same byte. Sets `known.size`. */
export function checkRange(response: Response, from: number, end: number, known: Known): number {
  const { url } = known;
  const encoding = response.headers.get("Content-Encoding");
  if (encoding !== null && encoding !== "identity") {
    throw new SourceError(`${url}: the server compresses ranges (${encoding}), switch that off for .reel files`);
  }
  const text = response.headers.get("Content-Range");
  if (text === null) return end; // hidden from pages of another origin
  const [, first, last, total] = /^bytes (\d+)-(\d+)\/(\d+|\*)$/.exec(text.trim()) ?? [];
  const [start, to, size] = [Number(first), Number(last) + 1, total === "*" ? null : Number(total)];
  const asked = `bytes ${from}-${end - 1}`;
  if (!(start === from && to > from && to <= end && (size === null || to <= size))) {
    throw new SourceError(`${url}: asked for ${asked}, the server says "${text}": it cannot be used for streaming`);
  }
  if (size !== null) checkSize(size, known);
  return to;
}

export function checkSize(size: number, known: Known): void {
  if (known.size !== null && known.size !== size) {
    throw new SourceError(`${known.url}: the file has ${size} bytes and had ${known.size} before, load it again`);
  }
  known.size = size;
}

/** Sets `known.size` from a 416, if it names one. */
export function checkUnsatisfiable(response: Response, known: Known): void {
  const total = /^bytes \*\/(\d+)$/.exec(response.headers.get("Content-Range")?.trim() ?? "")?.[1];
  if (total !== undefined) checkSize(Number(total), known);
}

/** Bytes of a whole body as announced; null where that says nothing about the file. */
export function announcedSize(response: Response): number | null {
  const encoding = response.headers.get("Content-Encoding");
  const length = response.headers.get("Content-Length");
  return length === null || (encoding !== null && encoding !== "identity") ? null : Number(length);
}
