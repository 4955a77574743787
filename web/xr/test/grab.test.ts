import { Matrix4, Object3D, Vector3 } from "three";
import { beforeEach, describe, expect, test } from "vitest";
import { Grab } from "../src/grab.ts";
import { applyPose, makePose, place, SCALES, setViewer } from "../src/pose.ts";
import type { Pose } from "../src/pose.ts";
import { Stick } from "../src/stick.ts";

const at = (x: number, y: number, z: number): Vector3 => new Vector3(x, y, z);

function matrixOf(pose: Pose): Matrix4 {
  const object = new Object3D();
  applyPose(pose, object);
  object.updateMatrix();
  return object.matrix.clone();
}

function expectNear(a: Vector3, b: Vector3): void {
  expect(a.distanceTo(b)).toBeLessThan(1e-9);
}

describe("hands that hold", () => {
  let pose: Pose;
  let grab: Grab;
  beforeEach(() => {
    pose = makePose();
    pose.position.set(0.3, -0.2, -1.5);
    pose.turn = 0.4;
    grab = new Grab();
  });

  test("one hand moves the recording by what it moves, and neither turns nor scales it", () => {
    grab.follow(pose, at(0.1, 1, -0.5), null);
    grab.follow(pose, at(0.4, 1.2, -0.9), null);
    expectNear(pose.position, at(0.6, 0, -1.9));
    expect(pose.turn).toBe(0.4);
    expect(pose.scale).toBe(1);
  });

  test("the other hand alone does the same", () => {
    grab.follow(pose, null, at(0, 0, 0));
    grab.follow(pose, null, at(1, 2, 3));
    expectNear(pose.position, at(1.3, 1.8, 1.5));
  });

  test("hands that take hold change nothing, nor do hands that let go", () => {
    const before = matrixOf(pose);
    grab.follow(pose, at(0, 1, 0), null);
    grab.follow(pose, at(0, 1, 0), at(0.5, 1, 0));
    grab.follow(pose, null, at(0.5, 1, 0));
    grab.follow(pose, null, null);
    grab.follow(pose, at(3, 3, 3), null);
    for (const [k, value] of matrixOf(pose).elements.entries()) expect(value).toBeCloseTo(before.elements[k], 12);
  });

  test("hands twice as far apart scale by two, and the point between them stays there", () => {
    const [left, right] = [at(-0.2, 1, -0.5), at(0.2, 1.2, -0.5)];
    const between = at(0, 1.1, -0.5);
    grab.follow(pose, left, right);
    const held = between.clone().applyMatrix4(matrixOf(pose).invert()); // of the recording
    grab.follow(pose, at(-0.4, 0.9, -0.5), at(0.4, 1.3, -0.5));
    expect(pose.scale).toBeCloseTo(2, 9);
    expectNear(held.clone().applyMatrix4(matrixOf(pose)), between);
  });

  test("two hands that move, turn and part at once carry what is at each hand with them", () => {
    grab.follow(pose, at(-0.2, 1, 0), at(0.2, 1, 0));
    const inverse = matrixOf(pose).invert();
    const [heldLeft, heldRight] = [at(-0.2, 1, 0), at(0.2, 1, 0)].map((point) => point.applyMatrix4(inverse));
    const [left, right] = [at(0.5, 1.4, 0.3), at(0.5, 1.4, -0.5)];
    grab.follow(pose, left, right);
    expect(pose.turn).toBeCloseTo(0.4 + Math.PI / 2, 9);
    expectNear(heldLeft.applyMatrix4(matrixOf(pose)), left);
    expectNear(heldRight.applyMatrix4(matrixOf(pose)), right);
  });

  test.each([
    [1000, SCALES.most],
    [1e-4, SCALES.least],
  ])("hands that part by %f scale no further than %f, and the point between them stays there", (factor, scale) => {
    grab.follow(pose, at(-1, 1, 0), at(1, 1, 0));
    const held = at(0, 1, 0).applyMatrix4(matrixOf(pose).invert());
    grab.follow(pose, at(-factor, 1, 0), at(factor, 1, 0));
    expect(pose.scale).toBe(scale);
    expectNear(held.applyMatrix4(matrixOf(pose)), at(0, 1, 0));
    grab.follow(pose, at(-1, 1, 0), at(1, 1, 0));
    expect(pose.scale).toBeCloseTo(1, 9);
  });

  test("hands above each other do not turn it", () => {
    grab.follow(pose, at(0, 1, 0), at(0.001, 1.5, 0));
    grab.follow(pose, at(0, 1, 0), at(0, 1.5, 0.001));
    expect(pose.turn).toBe(0.4);
  });

  test("a pose changed while held is held as it is now", () => {
    grab.follow(pose, at(0, 0, 0), null);
    pose.position.set(5, 5, 5);
    grab.release();
    grab.follow(pose, at(1, 0, 0), null);
    expectNear(pose.position, at(5, 5, 5));
  });
});

describe("where it stands", () => {
  const orientation = (x: number, y: number, z: number, w: number): DOMPointReadOnly => ({ x, y, z, w }) as DOMPointReadOnly;
  const person = { minimum: [1, 0.4, 2], size: [0.8, 1.8, 0.6] } as const;

  test("its lowest point on the floor, its middle 1.5 m ahead", () => {
    const pose = makePose();
    place(person, { x: 0, z: 0, turn: 0 }, pose);
    expectNear(at(1.4, 0.4, 2.3).applyMatrix4(matrixOf(pose)), at(0, 0, -1.5));
    expect(pose.scale).toBe(1);
  });

  test("ahead of a viewer who stands aside and looks to the left, and facing them", () => {
    const pose = makePose();
    place(person, { x: 2, z: 1, turn: Math.PI / 2 }, pose);
    expectNear(at(1.4, 0.4, 2.3).applyMatrix4(matrixOf(pose)), at(0.5, 0, 1));
    expectNear(at(0, 0, 1).transformDirection(matrixOf(pose)), at(1, 0, 0));
  });

  test("around the viewer where it is a room", () => {
    const pose = makePose();
    place({ minimum: [0, -1, 0], size: [5, 2.5, 2] }, { x: 1, z: 0, turn: 0 }, pose);
    expectNear(at(2.5, -1, 1).applyMatrix4(matrixOf(pose)), at(1, 0, 0));
  });

  test("as its first view looks at it; in a room from where that looks", () => {
    const pose = makePose();
    const view = { position: [-2, 1.6, 0.5], target: [1, 1, 0.5], fov: 45 } as const;
    place(person, { x: 2, z: 1, turn: Math.PI / 2 }, pose, false, view);
    expectNear(at(1, 0.4, 0.5).applyMatrix4(matrixOf(pose)), at(0.5, 0, 1));
    expectNear(at(-1, 0, 0).transformDirection(matrixOf(pose)), at(1, 0, 0)); // the side that the view is on is the viewer's
    place({ minimum: [-5, 0, -5], size: [10, 2.5, 10] }, { x: 1, z: 0, turn: 0 }, pose, false, view);
    expectNear(at(-2, 0, 0.5).applyMatrix4(matrixOf(pose)), at(1, 0, 0));
    expectNear(at(1, 0, 0).transformDirection(matrixOf(pose)), at(0, 0, -1));
  });

  test.each([
    ["level", orientation(0, Math.sin(0.35), 0, Math.cos(0.35)), 0.7],
    ["straight down", orientation(-Math.SQRT1_2, 0, 0, Math.SQRT1_2), 0],
    ["straight up", orientation(Math.SQRT1_2, 0, 0, Math.SQRT1_2), 0],
  ])("the way of a head that looks %s", (_, look, turn) => {
    const viewer = { x: 0, z: 0, turn: 9 };
    setViewer(viewer, orientation(1, 2, 3, 0), look);
    expect(viewer.x).toBe(1);
    expect(viewer.z).toBe(3);
    expect(viewer.turn).toBeCloseTo(turn, 9);
  });
});

describe("a thumbstick", () => {
  let told: string[];
  let stick: Stick;
  beforeEach(() => {
    told = [];
    stick = new Stick({ tap: (side) => told.push(`tap ${side}`), hold: (side) => told.push(`hold ${side}`), click: () => told.push("click") });
  });

  test("a push that is soon let go is a tap", () => {
    stick.update(-0.9, false, 0);
    expect(told).toEqual([]);
    stick.update(-0.5, false, 100);
    stick.update(0, false, 120);
    stick.update(0, false, 2000);
    expect(told).toEqual(["tap -1"]);
  });

  test("one that is held repeats and is no tap", () => {
    for (let now = 0; now <= 1000; now += 50) stick.update(1, false, now);
    stick.update(0, false, 1010);
    expect(told).toEqual(["hold 1", "hold 1", "hold 1"]);
  });

  test("a slight touch is nothing, a flick across is a tap to each side", () => {
    stick.update(0.5, false, 0);
    expect(told).toEqual([]);
    stick.update(1, false, 10);
    stick.update(-1, false, 30);
    stick.update(-1, false, 40);
    stick.update(0, false, 60);
    expect(told).toEqual(["tap 1", "tap -1"]);
  });

  test("a click is told once, and again only after it was let go", () => {
    for (const pressed of [true, true, false, true]) stick.update(0, pressed, 0);
    expect(told).toEqual(["click", "click"]);
  });

  test("a controller that goes away while pushed leaves no tap", () => {
    stick.update(1, false, 0);
    stick.reset();
    stick.update(0, false, 50);
    expect(told).toEqual([]);
  });
});
