// Messages for viewers when something fails: plain words, the remedy, and the exact error below.

import { FormatError, SourceError, type FormatErrorKind, type SourceErrorKind } from "@meshreel/player-core/errors";
import { GraphicsError } from "./stage.ts";

export interface Message {
  readonly title: string;
  readonly advice: string;
  readonly detail: string; // the error's own words
  readonly retry: boolean; // true if trying again can help
}

type Words = Omit<Message, "detail" | "retry">;

const FOREIGN: Words = { title: "This is not a .reel file", advice: "Open a file that meshreel wrote, or correct the address." };

const OF_FORMAT: Readonly<Record<FormatErrorKind, Words>> = {
  damaged: { title: "This file is damaged", advice: "It ends too early or its bytes were changed. Download it again." },
  foreign: FOREIGN,
  newer: { title: "This file is newer than the player", advice: "Update the player, then open it again." },
};

const OF_SOURCE: Readonly<Record<SourceErrorKind, Words>> = {
  missing: { title: "The recording was not found", advice: "The address may be wrong, or the file was moved." },
  refused: { title: "Access denied", advice: "The server refuses to send the recording. Sign in, or ask its owner." },
  failing: { title: "Server error", advice: "Try again in a moment." },
  unreachable: { title: "The recording could not be loaded", advice: "The server did not answer. Check your connection." },
  foreign: FOREIGN,
  unusable: { title: "The recording cannot be read", advice: "The server sent unexpected data. Try again, or send its owner the message below." },
};

const NO_GRAPHICS: Words = {
  title: "WebGL 2 is not available",
  advice: "Turn on graphics acceleration in the browser's settings, or use another browser.",
};
const OTHER: Words = { title: "The recording cannot be played", advice: "Something went wrong in the player." };

/** The message for an error of a source, a file or the GPU. */
export function explain(error: Error): Message {
  return { ...wordsFor(error), detail: error.message, retry: !(error instanceof FormatError && error.kind === "newer") };
}

function wordsFor(error: Error): Words {
  if (error instanceof FormatError) return OF_FORMAT[error.kind];
  if (error instanceof SourceError) return OF_SOURCE[error.kind];
  return error instanceof GraphicsError ? NO_GRAPHICS : OTHER;
}
