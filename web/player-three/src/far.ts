// Bodies that are seen so small that their textures make no difference to the colours of their vertices.

import type { Shown } from "@meshreel/player-core/types";

const [SMALL, LARGE] = [60, 90]; // pixels across all that a body does: below, and from which on again, its texture is left out (guess)

/** Takes in the tracks that are small from a place in the scene, takes out those that are not. `focal`: pixels of what is as large as it is far. */
export function updateFar(far: Set<number>, { groups }: Shown, { x, y, z }: { readonly x: number; readonly y: number; readonly z: number }, focal: number): void {
  groups.forEach((group, track) => {
    if (group === null) return;
    const { minimum, size } = group.box;
    const [right, up, out] = minimum.map((low, k) => low + size[k] / 2);
    const pixels = (focal * Math.hypot(...size)) / Math.hypot(right - x, up - y, out - z);
    if (pixels < SMALL) far.add(track);
    else if (pixels >= LARGE) far.delete(track);
  });
}
