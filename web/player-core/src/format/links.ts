// Dependencies of chunks: the chains in which groups and states of the background are predicted.

import { Form } from "./layout.gen.ts";
import { isCompanion, isVideo } from "./reader.ts";
import type { Chunk, CompanionChunk, Head } from "./reader.ts";
import type { Rendition } from "../types.ts";

export class Links {
  readonly #previous: (Chunk | null)[];
  readonly #roots: Int32Array;
  readonly #dependents: number[][];

  constructor(head: Head) {
    const { chunks } = head;
    this.#previous = chunks.map((chunk) => previousOf(head, chunk));
    this.#roots = new Int32Array(chunks.length);
    this.#dependents = chunks.map(() => []);
    this.#previous.forEach((previous, number) => {
      this.#roots[number] = previous === null ? number : this.#roots[previous.number];
      if (previous !== null) this.#dependents[previous.number].push(number);
    });
  }

  /**
   * The chunk whose state one needs to be decoded: the group before it, or the state of the background that it changes. Of a companion the one
   * of that chunk, where it needs it.
   */
  previousOf(chunk: Chunk): Chunk | null {
    return this.#previous[chunk.number];
  }

  /** Number of the first chunk of the chain that one is in; its own where it stands alone. */
  rootOf(chunk: Chunk): number {
    return this.#roots[chunk.number];
  }

  /** A chunk and all that cannot be decoded without it, but for companions of these. */
  withDependents(number: number): number[] {
    const found = [number];
    for (const other of found) for (const dependent of this.#dependents[other]) found.push(dependent);
    return found;
  }
}

function previousOf(head: Head, chunk: Chunk): Chunk | null {
  if (chunk.kind === "group") return head.groupBefore(chunk);
  return isCompanion(chunk) ? head.companionBefore(chunk) : head.changedFrom(chunk);
}

/** The most layers beyond the first that a chunk has. */
export function mostLayers(chunk: Chunk): number {
  return chunk.layers.length - 1;
}

/** Bytes of the first layers of a chunk. */
export function sizeOfLayers(chunk: Chunk, layers: number): number {
  let size = 0;
  for (let k = 0; k < Math.min(layers, chunk.layers.length); k++) size += chunk.layers[k].size;
  return size;
}

/** Number of a companion's layers that are wanted with the first `layers` of its chunk; with the first layer alone, textures are dropped. */
export function companionLayers(chunk: Chunk, companion: Chunk, layers: number): number {
  const isScaled = chunk.form === Form.LAYERS && layers < chunk.layers.length;
  if (isScaled && layers === 1 && (companion.kind === "atlas" || isVideo(companion))) return 0;
  return isScaled ? Math.min(layers, companion.layers.length) : companion.layers.length;
}

/** Companions that a viewer wants, beside colours. */
export interface Wanted {
  readonly textures: Rendition | null; // of this rendition
  readonly splats: boolean;
}

/** Companions that are wanted with a chunk. */
export function companionsWith(head: Head, chunk: Chunk, { textures, splats }: Wanted): readonly CompanionChunk[] {
  const isWanted = ({ kind }: CompanionChunk): boolean => {
    if (kind === "colors") return true;
    return kind === "splats" ? splats : textures !== null && (kind === "atlas" || kind === textures);
  };
  return head.companionsOf(chunk).filter(isWanted);
}

/** Bytes of the first layers of a chunk, and of what is wanted of its companions with these. */
export function sizeWithCompanions(head: Head, chunk: Chunk, layers: number, wanted: Wanted): number {
  const own = sizeOfLayers(chunk, layers);
  return companionsWith(head, chunk, wanted).reduce((sum, companion) => sum + sizeOfLayers(companion, companionLayers(chunk, companion, layers)), own);
}
