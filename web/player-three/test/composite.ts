// Splats drawn on white without a GPU, as analysis/appearance/splat_raster.py: what their shaders must come near to.

import type { Bound } from "../../player-core/test/whole_video.ts";
import type { Vector } from "../src/colors.ts";

const [BLUR, MOST, LEAST] = [0.3, 0.999, 1 / 255];
const TANGENT = Math.tan((25 * Math.PI) / 180); // of half the height's angle of view

interface Flat {
  readonly depth: number;
  readonly middle: readonly [number, number]; // pixels, from the lower left corner
  readonly conic: readonly [number, number, number];
  readonly splat: Bound;
}

const dot = (a: readonly number[], b: readonly number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a: Vector): Vector => [a[0] / Math.hypot(...a), a[1] / Math.hypot(...a), a[2] / Math.hypot(...a)];
const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Red, green and blue of all pixels, rows from the bottom, 0 to 255, from a place that looks at the origin. */
export function composite(splats: readonly Bound[], from: Vector, width: number, height: number): Float64Array {
  const forward = unit([-from[0], -from[1], -from[2]]);
  const right = unit(cross(forward, [0, 1, 0]));
  const up = cross(right, forward);
  const focal = height / 2 / TANGENT;
  const flats = splats.map((splat): Flat => {
    const place = splat.means.map((value, k) => value - from[k]);
    const [x, y, depth] = [dot(place, right), dot(place, up), dot(place, forward)];
    const axes = splat.axes.map((axis, k) => [right, up, forward].map((side) => splat.scales[k] * dot(axis, side)));
    const [across, above] = [0, 1].map((side) => axes.map((axis) => (focal * (axis[side] - ([x, y][side] / depth) * axis[2])) / depth));
    const [xx, xy, yy] = [dot(across, across) + BLUR, dot(across, above), dot(above, above) + BLUR];
    const area = xx * yy - xy * xy;
    return { depth, middle: [width / 2 + (focal * x) / depth, height / 2 + (focal * y) / depth], conic: [yy / area, -xy / area, xx / area], splat };
  });
  flats.sort((a, b) => a.depth - b.depth);
  const pixels = new Float64Array(3 * width * height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      let left = 1;
      const color = [0, 0, 0];
      for (const { middle, conic, splat } of flats) {
        const [dx, dy] = [column + 0.5 - middle[0], row + 0.5 - middle[1]];
        const alpha = Math.min(MOST, splat.opacities * Math.exp(-0.5 * (conic[0] * dx * dx + conic[2] * dy * dy) - conic[1] * dx * dy));
        if (alpha < LEAST) continue;
        for (let k = 0; k < 3; k++) color[k] += left * alpha * splat.colors[k];
        left *= 1 - alpha;
      }
      for (let k = 0; k < 3; k++) pixels[3 * (row * width + column) + k] = 255 * (color[k] + left);
    }
  }
  return pixels;
}
