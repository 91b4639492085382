/** Limbs that reach by analytic two-bone inverse kinematics, and hips that move over feet that stay. */

import { MathUtils, Quaternion, Vector3 } from "three";
import type { Pose, Rig } from "../rig";
import {
  forward,
  hangsOn,
  hipsOf,
  localRotation,
  placeAt,
  placeOf,
  rotationAt,
  turnOf,
  type Globals,
  type Skeleton,
  type Triple,
} from "./kinematics";

/** Three joints, each somewhere below the one before; others, such as twist bones, may lie between. */
export interface Limb {
  readonly upper: number;
  readonly mid: number;
  readonly end: number;
  /** Whether it bends forward (knees) or backward (elbows) where its pose does not say. */
  readonly forward: boolean;
}

export type LimbName = "LeftArm" | "RightArm" | "LeftLeg" | "RightLeg";
export const LIMBS: readonly LimbName[] = ["LeftArm", "RightArm", "LeftLeg", "RightLeg"];

type Body = Skeleton & Pick<Rig, "humanoid">;

/** Below this share of the limb's length, a bend is too slight to say in which plane it lies. */
const STRAIGHT = 1e-3;
const DOWN = new Vector3(0, -1, 0);

/** A limb of a humanoid; null where the rig does not have all of it. */
export function limbOf(rig: Body, name: LimbName): Limb | null {
  const side = name.startsWith("Left") ? "Left" : "Right";
  const leg = name.endsWith("Leg");
  const names = leg ? ["UpLeg", "Leg", "Foot"] : ["Arm", "ForeArm", "Hand"];
  const [upper, mid, end] = names.map((part) => rig.humanoid[side + part]);
  if (upper === undefined || mid === undefined || end === undefined) return null;
  if (upper === mid || mid === end || !hangsOn(rig, mid, upper) || !hangsOn(rig, end, mid)) return null;
  return { upper, mid, end, forward: leg };
}

/** The limb whose end or middle a joint is. */
export function limbAt(rig: Body, joint: number): { limb: Limb; part: "mid" | "end" } | null {
  for (const name of LIMBS) {
    const limb = limbOf(rig, name);
    if (limb?.end === joint) return { limb, part: "end" };
    if (limb?.mid === joint) return { limb, part: "mid" };
  }
  return null;
}

/**
 * A copy of the pose whose limb ends at `target`, or as near to it as its bones allow. The plane in which the limb bends
 * is turned no more than needed, and the end keeps its rotation in the world, or takes `rotation`.
 */
export function reach(rig: Body, pose: Pose, limb: Limb, target: Triple, rotation?: Quaternion): Pose {
  const globals = forward(rig, pose);
  const upper = placeOf(globals, limb.upper);
  const mid = placeOf(globals, limb.mid);
  const end = placeOf(globals, limb.end);
  const above = mid.clone().sub(upper);
  const below = end.clone().sub(mid);
  const a = above.length();
  const b = below.length();
  const goal = new Vector3(...target).sub(upper);
  if (a < 1e-9 || b < 1e-9) return pose.slice();
  const normal = bendAxis(rig, globals, limb, above, below);
  const far = MathUtils.clamp(goal.length(), Math.abs(a - b), a + b);
  const bent = angleBetween(above, below);
  const wanted = Math.acos(MathUtils.clamp((far * far - a * a - b * b) / (2 * a * b), -1, 1));
  const bend = new Quaternion().setFromAxisAngle(normal, wanted - bent);
  below.applyQuaternion(bend);
  const swing = turnTo(above.clone().add(below), goal, normal);
  return turned(rig, pose, globals, limb, swing, bend, rotation);
}

/** A copy of the pose whose limb is turned about the axis from its upper joint to its end, so that its middle points at `toward`. */
export function turnMiddle(rig: Body, pose: Pose, limb: Limb, toward: Triple): Pose {
  const globals = forward(rig, pose);
  const upper = placeOf(globals, limb.upper);
  const axis = placeOf(globals, limb.end).sub(upper);
  if (axis.lengthSq() < 1e-12) return pose.slice();
  axis.normalize();
  const from = placeOf(globals, limb.mid).sub(upper).projectOnPlane(axis);
  const to = new Vector3(...toward).sub(upper).projectOnPlane(axis);
  if (from.lengthSq() < 1e-8 || to.lengthSq() < 1e-8) return pose.slice();
  const angle = Math.atan2(from.clone().cross(to).dot(axis), from.dot(to));
  return turned(rig, pose, globals, limb, new Quaternion().setFromAxisAngle(axis, angle), new Quaternion());
}

/** A copy of the pose whose root moves so that the hips are at `target`, with both feet where and as they were. */
export function moveHips(rig: Body, pose: Pose, target: Triple): Pose {
  const before = forward(rig, pose);
  const at = placeOf(before, hipsOf(rig));
  let moved = shifted(rig, pose, [target[0] - at.x, target[1] - at.y, target[2] - at.z]);
  for (const name of ["LeftLeg", "RightLeg"] as const) {
    const limb = limbOf(rig, name);
    if (limb) moved = reach(rig, moved, limb, placeOf(before, limb.end).toArray(), turnOf(before, limb.end));
  }
  return moved;
}

/** A copy of the pose with its root moved; of a rig whose joints move, the root's place among them goes along. */
export function shifted(rig: Skeleton, pose: Pose, by: Triple): Pose {
  const made = pose.slice();
  const place = placeAt(rig.parents.length, 0);
  for (let i = 0; i < 3; i++) {
    if (rig.moved && Math.abs(pose[place + i] - pose[i]) < 1e-5) made[place + i] = pose[i] + by[i];
    made[i] = pose[i] + by[i];
  }
  return made;
}

/** A copy of the pose whose joint is turned by `rotation` in the world; what hangs on it goes along. */
export function withTurn(rig: Skeleton, pose: Pose, globals: Globals, joint: number, rotation: Quaternion): Pose {
  const made = pose.slice();
  setLocal(made, joint, localRotation(rig, globals, joint, rotation));
  return made;
}

/** The axis about which a limb bends more: from the pose, or, of a straight limb, from where the body looks. */
function bendAxis(rig: Body, globals: Globals, limb: Limb, above: Vector3, below: Vector3): Vector3 {
  const normal = above.clone().cross(below);
  if (normal.length() > STRAIGHT * above.length() * below.length()) return normal.normalize();
  const ahead = facing(rig, globals);
  const pole = limb.forward ? ahead : ahead.negate().addScaledVector(DOWN, 0.2);
  const axis = pole.cross(above);
  if (axis.length() < 1e-4 * above.length()) axis.set(1, 0, 0).cross(above);
  if (axis.length() < 1e-4 * above.length()) axis.set(0, 0, 1).cross(above);
  return axis.normalize();
}

/** The facing of the body, from its hips. */
function facing(rig: Body, globals: Globals): Vector3 {
  const { LeftUpLeg, RightUpLeg } = rig.humanoid;
  if (LeftUpLeg === undefined || RightUpLeg === undefined) return new Vector3(0, 0, 1);
  const across = placeOf(globals, LeftUpLeg).sub(placeOf(globals, RightUpLeg));
  const spine = rig.humanoid.Neck ?? rig.humanoid.Head ?? rig.humanoid.Spine;
  const up = spine === undefined ? new Vector3(0, 1, 0) : placeOf(globals, spine).sub(placeOf(globals, RightUpLeg));
  const ahead = across.cross(up);
  return ahead.lengthSq() < 1e-12 ? new Vector3(0, 0, 1) : ahead.normalize();
}

/** The smallest turn from one direction to another; of opposite ones, half a turn about `axis`. */
function turnTo(from: Vector3, to: Vector3, axis: Vector3): Quaternion {
  if (from.lengthSq() < 1e-16 || to.lengthSq() < 1e-16) return new Quaternion();
  const [a, b] = [from.clone().normalize(), to.clone().normalize()];
  if (a.dot(b) < -0.999999) return new Quaternion().setFromAxisAngle(axis, Math.PI);
  return new Quaternion().setFromUnitVectors(a, b);
}

/** `bend` turns the lower part in the world, then `swing` the whole limb. */
function turned(
  rig: Skeleton,
  pose: Pose,
  globals: Globals,
  limb: Limb,
  swing: Quaternion,
  bend: Quaternion,
  rotation = turnOf(globals, limb.end),
): Pose {
  const made = withTurn(rig, pose, globals, limb.upper, swing.clone().multiply(turnOf(globals, limb.upper)));
  setLocal(made, limb.mid, localRotation(rig, globals, limb.mid, bend.clone().multiply(turnOf(globals, limb.mid))));
  setLocal(made, limb.end, localRotation(rig, forward(rig, made), limb.end, rotation));
  return made;
}

function setLocal(pose: Pose, joint: number, rotation: Quaternion): void {
  rotation.normalize().toArray(pose, rotationAt(joint));
}

function angleBetween(a: Vector3, b: Vector3): number {
  return Math.atan2(a.clone().cross(b).length(), a.dot(b));
}
