// Files of the built player. What is large lies there twice, as it is and as a gzip: hosts that compress nothing send the gzip, which the
// browser unpacks.

const PACKED = ".gz";

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

/** Bytes of a file, or of the plain one where its gzip is missing or damaged. Rejects where they do not come. */
export async function bytesOf(file: URL): Promise<ArrayBuffer> {
  if (!file.pathname.endsWith(PACKED)) return fetched(file);
  return fetched(file).then(unpacked).catch(() => fetched(plainOf(file)));
}

/** A module, or the plain one where its gzip is missing or a policy of the page refuses what is unpacked. */
export async function importFile<T>(file: URL): Promise<T> {
  if (!file.pathname.endsWith(PACKED)) return (await import(/* @vite-ignore */ file.href)) as T;
  const address = URL.createObjectURL(new Blob([await bytesOf(file)], { type: "text/javascript" }));
  try {
    return (await import(/* @vite-ignore */ address)) as T;
  } catch {
    return importFile(plainOf(file));
  } finally {
    URL.revokeObjectURL(address);
  }
}

/** Address of the file whose gzip this may be. */
export function plainOf(file: URL): URL {
  const plain = new URL(file);
  plain.pathname = file.pathname.replace(/\.gz$/, "");
  return plain;
}

async function fetched(file: URL): Promise<ArrayBuffer> {
  const response = await fetch(file);
  if (!response.ok) throw new Error(`${file.href}: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}

/** The contents of a gzip; some servers send a gzip's contents in its place. */
async function unpacked(bytes: ArrayBuffer): Promise<ArrayBuffer> {
  const [first, second] = new Uint8Array(bytes);
  if (first !== 0x1f || second !== 0x8b) return bytes;
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
