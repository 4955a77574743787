// Files of the built player. What is large lies there twice, as it is and as a gzip: hosts that compress nothing send the gzip, which the
// browser unpacks.

export const PACKED = ".gz";

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
