// The compiled core and Draco, from their wasm bytes. Runs in a worker and in Node.

import createDecoderModule from "draco3d/draco_decoder_nodejs.js";

import type { Tools } from "./group.ts";
import { Core } from "../wasm/memory.ts";

/** Both, ready for use. */
export async function makeTools(core: WebAssembly.Module, draco: ArrayBuffer): Promise<Tools> {
  return { core: await Core.create(core), draco: await createDecoderModule({ wasmBinary: draco }) };
}
