// Files beside a script of the built player, which a page names or its host packs.

import { PACKED } from "@meshreel/player-core/net/built";

/**
 * Address of a file beside a script of the built player: of its gzip, unless the page names the plain file in a link that loads it ahead, the browser
 * unpacks nothing, or it is a script and the host compresses those. Few hosts compress wasm.
 */
export function fileBeside(script: string, name: string): URL {
  const file = new URL(name, script);
  const isNamed = [...document.querySelectorAll("link")].some(({ href }) => href === file.href);
  const isPacked = typeof DecompressionStream === "function" && !isNamed && (name.endsWith(".wasm") || comesPlain(script));
  return isPacked ? new URL(name + PACKED, script) : file;
}

/** True where a script came as it is; false where that is hidden, as of another origin. */
function comesPlain(script: string): boolean {
  const [{ encodedBodySize, decodedBodySize } = { encodedBodySize: 0, decodedBodySize: 0 }] = performance.getEntriesByName(script) as PerformanceResourceTiming[];
  return encodedBodySize > 0 && encodedBodySize === decodedBodySize;
}
