// What files and pictures may cost, by the bytes that they have. Beside format/budget.py; the decoder counts what chunks cost.

import { FormatError } from "../errors.ts";
import { LIMITS } from "./layout.gen.ts";

/** Memory that the groups of one frame may take, which have `size` bytes together. */
export function together(size: number): number {
  return LIMITS.together + LIMITS.perByte * size;
}

/** FormatError where the groups of a file have more frames, of all tracks, than its bytes may. */
export function checkFrames(frames: number, size: number): void {
  const most = LIMITS.frames + LIMITS.framesPerByte * size;
  if (frames > most) throw new FormatError(`${frames} frames of all tracks in a file of ${size} bytes, over ${most}`);
}

/** FormatError where a video of so many texels, of all pictures of a chunk or layer together, costs more than `size` bytes may. */
export function checkPictures(texels: number, size: number): void {
  const cost = LIMITS.texel * texels;
  if (cost > LIMITS.pictures + LIMITS.perByte * size) throw new FormatError(`pictures: ${size} bytes that cost ${cost} to decode`);
}
