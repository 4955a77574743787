// Pose of the recording in the room. Room: metres, y up, y = 0 on the floor, as WebXR's local-floor has it.

import { Quaternion, Vector3 } from "three";
import type { Object3D } from "three";
import type { Box, FirstView } from "@meshreel/player-core/types";

export const SCALES = { least: 0.05, most: 20 } as const;

const DISTANCE = 1.5; // m from the viewer to the middle of the recording
const MODEL = 1; // m: how wide a room is that stands in another
const ROOM = 3; // m; what is larger is stood in, not looked at
export const UP = new Vector3(0, 1, 0);

/** A similarity that keeps the vertical. */
export interface Pose {
  readonly position: Vector3; // m, of the recording's own zero
  turn: number; // rad about the vertical, counter-clockwise from above
  scale: number;
}

/** The viewer on the floor. */
export interface Viewer {
  x: number; // m
  z: number; // m
  turn: number; // rad about the vertical; 0 looks along -z
}

export function makePose(): Pose {
  return { position: new Vector3(), turn: 0, scale: 1 };
}

export function copyPose(from: Pose, to: Pose): void {
  to.position.copy(from.position);
  to.turn = from.turn;
  to.scale = from.scale;
}

export function applyPose(pose: Pose, object: Object3D): void {
  object.position.copy(pose.position);
  object.quaternion.setFromAxisAngle(UP, pose.turn);
  object.scale.setScalar(pose.scale);
}

/**
 * Stands the recording in front of the viewer, or around them where it is a room: at true scale, its lowest point on the floor. With `passthrough`
 * they are in a room already: another one stands before them as a model. With a `view` they look as it does, in a room from where it does.
 */
export function place(box: Box, viewer: Viewer, pose: Pose, passthrough = false, view: FirstView | null = null): void {
  const wide = Math.max(box.size[0], box.size[2]);
  const distance = wide > ROOM && !passthrough ? 0 : DISTANCE;
  const middle = [box.minimum[0] + box.size[0] / 2, 0, box.minimum[2] + box.size[2] / 2];
  const [x, , z] = view === null ? middle : distance === 0 ? view.position : view.target;
  pose.turn = viewer.turn - (view === null ? 0 : Math.atan2(view.position[0] - view.target[0], view.position[2] - view.target[2]));
  const [sin, cos] = [Math.sin(pose.turn), Math.cos(pose.turn)];
  const scale = (pose.scale = wide > ROOM && passthrough ? MODEL / wide : 1);
  pose.position.set(viewer.x - distance * Math.sin(viewer.turn) - scale * (cos * x + sin * z), -scale * box.minimum[1], viewer.z - distance * Math.cos(viewer.turn) - scale * (cos * z - sin * x));
}

/** Has a viewer look at a point of the floor from where `place` stands a recording there in their own room. */
export function standBefore(viewer: Viewer, { x, z }: Vector3): void {
  viewer.turn = Math.atan2(viewer.x - x, viewer.z - z);
  viewer.x = x + DISTANCE * Math.sin(viewer.turn);
  viewer.z = z + DISTANCE * Math.cos(viewer.turn);
}

/** Position and direction of a head, seen from above. */
export function setViewer(viewer: Viewer, position: DOMPointReadOnly, orientation: DOMPointReadOnly): void {
  const rotation = new Quaternion(orientation.x, orientation.y, orientation.z, orientation.w);
  const forward = new Vector3(0, 0, -1).applyQuaternion(rotation);
  const steep = Math.hypot(forward.x, forward.z) < 0.2; // up or down: then the top of the head gives the direction
  const told = steep ? new Vector3(0, -Math.sign(forward.y), 0).applyQuaternion(rotation) : forward;
  viewer.x = position.x;
  viewer.z = position.z;
  viewer.turn = Math.atan2(-told.x, -told.z);
}
