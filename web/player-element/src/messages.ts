// What a viewer is told when something fails: plain words, what can be done, and the exact error below. The patterns are of the
// messages of player-core (checks.ts, reader.ts, http_answer.ts) and of stage_three.ts.

export interface Message {
  readonly title: string;
  readonly advice: string;
  readonly detail: string; // the error's own words
  readonly retry: boolean; // whether trying again can help
}

const CASES: readonly { pattern: RegExp; title: string; advice: string; retry: boolean }[] = [
  { pattern: /webgl/i, title: "This browser cannot draw it", advice: "WebGL 2 is switched off or missing. Switch on graphics acceleration, or use another browser.", retry: true },
  { pattern: /not found \((404|410)\)/, title: "The recording was not found", advice: "The address may be wrong, or the file was moved.", retry: true },
  { pattern: /refused \((401|403)\)/, title: "The recording is not open to you", advice: "The server refuses it. Sign in where it is kept, or ask its owner.", retry: true },
  { pattern: /answers 5\d\d/, title: "The server has a problem", advice: "Try again in a moment.", retry: true },
  { pattern: /^format version \d/, title: "This file is newer than the player", advice: "Update the player, then open it again.", retry: false },
  { pattern: /not a \.reel file|sends a web page/, title: "This is not a .reel file", advice: "Open a file that meshreel wrote, or correct the address.", retry: true },
];

/** The message for an error of a source, a file or the GPU. */
export function explain(error: Error): Message {
  const detail = error.message;
  const found = CASES.find(({ pattern }) => pattern.test(detail));
  if (found) return { title: found.title, advice: found.advice, detail, retry: found.retry };
  if (error.name === "FormatError") {
    return { title: "This file is damaged", advice: "It ends too early or its bytes were changed. Fetch it again.", detail, retry: true };
  }
  if (error.name === "SourceError" || error instanceof TypeError) {
    return { title: "The recording cannot be fetched", advice: "The server did not answer. Look at your connection.", detail, retry: true };
  }
  return { title: "The recording cannot be played", advice: "Something went wrong in the player.", detail, retry: true };
}
