// The decoder's tools for tests in Node.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

import type { Tools } from "../src/decode/group.ts";
import { makeTools } from "../src/decode/tools.ts";

export const ROOT = fileURLToPath(new URL("../../..", import.meta.url));

export function buffer(path: string): ArrayBuffer {
  const bytes = readFileSync(path);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) as ArrayBuffer;
}

export const coreWasm = (): ArrayBuffer => buffer(`${ROOT}/src/meshreel/player/core.wasm`);
export const dracoWasm = (): ArrayBuffer => buffer(createRequire(import.meta.url).resolve("draco3d/draco_decoder.wasm"));

export async function nodeTools(): Promise<Tools> {
  return makeTools(await WebAssembly.compile(coreWasm()), dracoWasm());
}
