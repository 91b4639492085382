/** A key pose as numbers to edit: place, facing, and the angles of each joint. */

import { Euler, Quaternion } from "three";
import { rotationAt } from "../../pose/kinematics";
import { groundOf, headingOf, moveOnGround, turnAboutHips } from "../../pose/place";
import type { Pose, Rig } from "../../rig";
import { degrees, radians } from "../controls/numbers";

export interface Place {
  readonly x: number;
  readonly z: number;
  /** Degrees from +Z towards +X. */
  readonly facing: number;
}

export function placeOfPose(rig: Rig, pose: Pose): Place {
  const [x, z] = groundOf(rig, pose);
  return { x, z, facing: degrees(headingOf(rig, pose)) };
}

/** The pose with one of the three changed. */
export function placed(rig: Rig, pose: Pose, what: keyof Place, value: number): Pose {
  const now = placeOfPose(rig, pose);
  if (what === "facing") return turnAboutHips(rig, pose, radians(value - now.facing));
  return moveOnGround(rig, pose, what === "x" ? value - now.x : 0, what === "z" ? value - now.z : 0);
}

export type Axis = "x" | "y" | "z";

/** A joint's rotation in its parent's frame: degrees about X, then Y, then Z of the turned joint. */
export function anglesOf(pose: Pose, joint: number): Record<Axis, number> {
  const { x, y, z } = new Euler().setFromQuaternion(new Quaternion().fromArray(pose, rotationAt(joint)), "XYZ");
  return { x: degrees(x), y: degrees(y), z: degrees(z) };
}

export function withAngle(pose: Pose, joint: number, axis: Axis, value: number): Pose {
  const angles = { ...anglesOf(pose, joint), [axis]: value };
  const turn = new Quaternion().setFromEuler(new Euler(radians(angles.x), radians(angles.y), radians(angles.z), "XYZ"));
  const made = pose.slice();
  turn.toArray(made, rotationAt(joint));
  return made;
}

/** Joints in the order of their tree, to choose one. */
export function jointTree(rig: Pick<Rig, "joints" | "parents">): { value: string; label: string }[] {
  const children = new Map<number, number[]>();
  rig.parents.forEach((parent, joint) => children.set(parent, [...(children.get(parent) ?? []), joint]));
  const made: { value: string; label: string }[] = [];
  const visit = (joint: number) => {
    made.push({ value: String(joint), label: rig.joints[joint] });
    for (const child of children.get(joint) ?? []) visit(child);
  };
  rig.parents.forEach((parent, joint) => {
    if (parent < 0) visit(joint);
  });
  return made;
}
