// A picture of 320 x 240 that a page of these tests has drawn, from a camera that looks along -z from (0, 0, 3) with 50 degrees.

import { expect } from "vitest";
import type { Vector } from "../src/colors.ts";

const [WIDTH, HEIGHT] = [320, 240];
const FOCAL = HEIGHT / 2 / Math.tan((25 * Math.PI) / 180); // pixels
const DISTANCE = 3; // m
const VISIBLE = 8; // of 255: a smaller difference is rounding

export class Picture {
  readonly #pixels: Uint8Array;

  /** Base64 of rows from the bottom, four bytes a pixel. */
  constructor(base64: string) {
    this.#pixels = Buffer.from(base64, "base64");
  }

  /** The colour where a point of the scene is seen. */
  at([x, y, z]: Vector): number[] {
    const scale = FOCAL / (DISTANCE - z);
    const [column, row] = [Math.floor(WIDTH / 2 + x * scale), Math.floor(HEIGHT / 2 + y * scale)];
    const offset = 4 * (row * WIDTH + column);
    return [...this.#pixels.subarray(offset, offset + 3)];
  }

  /** The share of pixels that are not white. */
  covered(): number {
    return this.#share((offset) => [0, 1, 2].some((k) => this.#pixels[offset + k] !== 255));
  }

  /** The share of pixels that differ visibly. */
  difference(other: Picture): number {
    return this.#share((offset) => [0, 1, 2].some((k) => Math.abs(this.#pixels[offset + k] - other.#pixels[offset + k]) > VISIBLE));
  }

  /** How many colours there are. */
  colors(): number {
    const seen = new Set<number>();
    for (let i = 0; i < this.#pixels.length; i += 4) seen.add((this.#pixels[i] << 16) | (this.#pixels[i + 1] << 8) | this.#pixels[i + 2]);
    return seen.size;
  }

  #share(holds: (offset: number) => boolean): number {
    let count = 0;
    for (let offset = 0; offset < this.#pixels.length; offset += 4) if (holds(offset)) count++;
    return count / (WIDTH * HEIGHT);
  }
}

declare module "vitest" {
  interface Matchers<T> {
    /** Each number at most `most` away. */
    toBeNear(expected: readonly number[], most: number): T;
  }
}

expect.extend({
  toBeNear(received: readonly number[], expected: readonly number[], most: number) {
    const pass = received.length === expected.length && received.every((value, i) => Math.abs(value - expected[i]) <= most);
    return { pass, message: () => `[${received.join(", ")}] is not within ${most} of [${expected.join(", ")}]` };
  },
});
