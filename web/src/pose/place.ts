/** Moving and turning a whole pose on the ground. */

import { Quaternion, Vector3 } from "three";
import type { Pose, Rig } from "../rig";
import { shifted, withTurn } from "./ik";
import { forward, hipsOf, placeOf, turnOf, type Skeleton } from "./kinematics";

type Body = Skeleton & Pick<Rig, "humanoid">;

const UP = new Vector3(0, 1, 0);

/** The ground under the hips: x and z. */
export function groundOf(rig: Body, pose: Pose): [number, number] {
  const { x, z } = placeOf(forward(rig, pose), hipsOf(rig));
  return [x, z];
}

/** A copy of the pose, moved on the ground. */
export function moveOnGround(rig: Skeleton, pose: Pose, x: number, z: number): Pose {
  return shifted(rig, pose, [x, 0, z]);
}

/** A copy of the pose, turned about the vertical through its hips; radians from +Z towards +X. */
export function turnAboutHips(rig: Body, pose: Pose, angle: number): Pose {
  const globals = forward(rig, pose);
  const [x, z] = groundOf(rig, pose);
  const turn = new Quaternion().setFromAxisAngle(UP, angle);
  const middle = new Vector3(x, 0, z);
  const root = placeOf(globals, 0);
  const goes = root.clone().sub(middle).applyQuaternion(turn).add(middle).sub(root);
  const made = withTurn(rig, pose, globals, 0, turn.multiply(turnOf(globals, 0)));
  return shifted(rig, made, [goes.x, 0, goes.z]);
}

/** Where the pose looks on the ground, radians from +Z towards +X: from how the hips lie, or else the root's own Z. */
export function headingOf(rig: Body, pose: Pose): number {
  const globals = forward(rig, pose);
  const { LeftUpLeg, RightUpLeg } = rig.humanoid;
  if (LeftUpLeg !== undefined && RightUpLeg !== undefined) {
    const { x, z } = placeOf(globals, LeftUpLeg).sub(placeOf(globals, RightUpLeg));
    if (Math.hypot(x, z) > 1e-6) return Math.atan2(-z, x);
  }
  const ahead = new Vector3(0, 0, 1).applyQuaternion(turnOf(globals, 0));
  return Math.atan2(ahead.x, ahead.z);
}
