// The page of conformance.browser.test.ts: decodes a file that it is given, in Chromium.

import { Video } from "./whole_video.ts";
import type { Mesh } from "./whole_video.ts";
import { Core } from "../src/wasm/core.ts";

async function digest(values: Float64Array | Int32Array): Promise<string> {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength).slice();
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return [...hash].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function recordOf(mesh: Mesh): Promise<object> {
  const [vertices, faces] = [mesh.vertices.length / 3, mesh.faces.length / 3];
  return { vertices, faces, vertices_sha256: await digest(mesh.vertices), faces_sha256: await digest(mesh.faces) };
}

/** The records of all frames of a file. */
async function decodeAll(core: number[], file: number[], layers: number | null): Promise<object[]> {
  const video = new Video(await Core.create(await WebAssembly.compile(Uint8Array.from(core))), Uint8Array.from(file), layers);
  return Promise.all(Array.from({ length: video.head.frameCount }, (_, frame) => recordOf(video.frame(frame))));
}

Object.assign(globalThis, { decodeAll });
