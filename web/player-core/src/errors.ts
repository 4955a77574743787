// Errors that a user sees: what is wrong, where, and what to do about it. Their kind is for programs; their message may change.

/** "foreign": no .reel file; "newer": of a version that this player does not know. */
export type FormatErrorKind = "damaged" | "foreign" | "newer";

/** "failing": the server has a problem of its own; "unusable": what it answers cannot be used, or the file cannot be read. */
export type SourceErrorKind = "missing" | "refused" | "failing" | "unreachable" | "foreign" | "unusable";

/** Bytes are no .reel file, or a damaged one. */
export class FormatError extends Error {
  override name = "FormatError";
  readonly kind: FormatErrorKind;

  constructor(message: string, kind: FormatErrorKind = "damaged") {
    super(message);
    this.kind = kind;
  }
}

/** A source could not be read: the network, the server or the file. */
export class SourceError extends Error {
  override name = "SourceError";
  readonly kind: SourceErrorKind;

  constructor(message: string, { kind = "unusable", ...options }: ErrorOptions & { readonly kind?: SourceErrorKind } = {}) {
    super(message, options);
    this.kind = kind;
  }
}
