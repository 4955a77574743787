// The compiled decoder for tests in Node.

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

import { Core } from "../src/wasm/core.ts";

export const ROOT = fileURLToPath(new URL("../../..", import.meta.url));

export function buffer(path: string): ArrayBuffer {
  const bytes = readFileSync(path);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) as ArrayBuffer;
}

export const coreWasm = (): ArrayBuffer => buffer(`${ROOT}/src/meshreel/player/core.wasm`);

export async function nodeCore(): Promise<Core> {
  return Core.create(await WebAssembly.compile(coreWasm()));
}
