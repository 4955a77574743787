// Errors that a user sees: what is wrong, where, and what to do about it.

/** Bytes are no .reel file, or a damaged one. */
export class FormatError extends Error {
  override name = "FormatError";
}

/** A source could not be read: the network, the server or the file. */
export class SourceError extends Error {
  override name = "SourceError";
}
