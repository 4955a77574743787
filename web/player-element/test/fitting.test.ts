import { PerspectiveCamera, Vector3 } from "three";
import { describe, expect, test } from "vitest";
import type { Box } from "@meshreel/player-core/types";
import { fitting, FROM, timesAway } from "../src/fitting.ts";

const TANGENT = Math.tan(Math.PI / 8); // of a picture of 45 degrees
const FREE = 0.96; // of its height, above the bar
const WALK: Box = { minimum: [-2, 0, -0.3], size: [4, 1.8, 0.6] }; // of all that somebody passes in a clip
const STANDING: Box = { minimum: [-0.4, 0, -0.3], size: [0.8, 1.8, 0.6] };
const ROOM: Box = { minimum: [-3, 0, -3], size: [6, 2.5, 6] };
const TARGET = new Vector3(0, 0.9, 0);

/** How far the box reaches from the middle of a picture to its sides, and above and below it: 1 is its border. */
function reaches(box: Box, eye: Vector3, target: Vector3, aspect: number): [number, number] {
  const camera = new PerspectiveCamera(45, aspect);
  camera.position.copy(eye);
  camera.lookAt(target);
  camera.updateMatrixWorld();
  const places = Array.from({ length: 8 }, (_, k) =>
    new Vector3(...box.minimum.map((low, axis) => low + ((k >> axis) & 1) * box.size[axis]!)).project(camera));
  return [Math.max(...places.map(({ x }) => Math.abs(x))), Math.max(...places.map(({ y }) => Math.abs(y)))];
}

const shown = (box: Box, away: Vector3, aspect: number): Vector3 =>
  away.clone().multiplyScalar(timesAway(box, TARGET, away, { tangent: TANGENT, aspect, free: FREE })).add(TARGET);

describe("a view of all that somebody passes while they walk through a clip", () => {
  test.each([4 / 3, 16 / 9, 2.4])("fills the width of a picture of %f, or its height", (aspect) => {
    const { lift, distance } = fitting(WALK, TANGENT * aspect, TANGENT);
    const target = new Vector3(0, 0.9 + lift, 0);
    const [aside, high] = reaches(WALK, target.clone().addScaledVector(FROM, distance), target, aspect);
    expect(Math.max(aside, high)).toBeCloseTo(1, 6);
    if (aspect < 2) expect(aside).toBeGreaterThan(0.9);
  });
});

describe("a file's view", () => {
  const away = new Vector3(0, 0.5, 6.5); // shows the walk in a square picture, from border to border

  test("of a walk leaves less than a third of a wide picture's width empty, and keeps all of it in the picture", () => {
    expect(reaches(WALK, away.clone().add(TARGET), TARGET, 1)[0]).toBeGreaterThan(0.75);
    expect(reaches(WALK, away.clone().add(TARGET), TARGET, 16 / 9)[0]).toBeLessThan(0.5);
    const [aside, high] = reaches(WALK, shown(WALK, away, 16 / 9), TARGET, 16 / 9);
    expect(aside).toBeGreaterThan(2 / 3);
    expect(aside).toBeLessThan(1);
    expect(high).toBeLessThan(FREE);
    expect(timesAway(WALK, TARGET, away, { tangent: TANGENT, aspect: 16 / 9, free: 1 })).toBeCloseTo(0.5935, 4); // as in posters and films
  });

  test("of somebody who stands keeps their head in a picture of which a bar covers much", () => {
    const [away, free] = [new Vector3(0, 0, 1.1 * (0.9 / TANGENT + 0.3)), 0.8];
    const times = timesAway(STANDING, TARGET, away, { tangent: TANGENT, aspect: 16 / 9, free });
    const [, high] = reaches(STANDING, away.clone().multiplyScalar(times).add(TARGET), TARGET, 16 / 9);
    expect(high).toBeGreaterThan(0.9 * free);
    expect(high).toBeLessThan(free);
  });

  test("whose target lies before all that is shown stays where it is", () => {
    const behind: Box = { minimum: [-0.1, 0.8, -2.5], size: [0.2, 0.2, 0.2] };
    for (const aspect of [0.5, 16 / 9]) expect(timesAway(behind, TARGET, away, { tangent: TANGENT, aspect, free: 1 })).toBeCloseTo(1 / Math.min(1, aspect), 9);
    expect(timesAway({ minimum: [0, 0.9, 0], size: [0, 0, 0] }, TARGET, away, { tangent: TANGENT, aspect: 2, free: 1 })).toBe(1);
  });

  test("shows as much from farther away in a picture that is higher than wide", () => {
    expect(shown(WALK, away, 0.5).sub(TARGET).length()).toBeCloseTo(2 * away.length(), 6);
  });

  test.each([
    ["of somebody who stands, whom the height holds", STANDING, new Vector3(0, 0.4, 2.8)],
    ["of a part alone", WALK, new Vector3(0, 0, 1)],
    ["from within a room", ROOM, new Vector3(0, 0.5, 2.5)],
  ])("%s stays where it is in a wide picture", (_, box, wanted) => {
    expect(shown(box, wanted, 16 / 9)).toEqual(wanted.clone().add(TARGET));
  });

  test.each([1, 3, 5.5, 6.5, 20])("is found again from the picture that shows it, from %f m away", (distance) => {
    const lens = { tangent: TANGENT, aspect: 16 / 9, free: FREE };
    const wanted = away.clone().setLength(distance);
    const picture = wanted.clone().multiplyScalar(timesAway(WALK, TARGET, wanted, lens));
    const found = picture.clone().divideScalar(timesAway(WALK, TARGET, picture, lens, true));
    expect(found.clone().multiplyScalar(timesAway(WALK, TARGET, found, lens)).distanceTo(picture)).toBeLessThan(1e-9);
  });
});
