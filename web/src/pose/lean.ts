/** A trunk that bends so that the head or the neck goes where it is dragged. */

import { Quaternion, Vector3 } from "three";
import type { Pose, Rig } from "../rig";
import { withTurn } from "./ik";
import { forward, hangsOn, placeOf, turnOf, type Skeleton, type Triple } from "./kinematics";

type Body = Skeleton & Pick<Rig, "humanoid">;

const TRUNK = ["Spine", "Spine1", "Spine2", "Neck"] as const;
const ROUNDS = 12;

/** The joints of the trunk, from below, that carry a joint. */
export function trunkBelow(rig: Body, end: number): number[] {
  const joints = TRUNK.map((name) => rig.humanoid[name]).filter((joint) => joint !== undefined);
  return joints.filter((joint) => joint !== end && hangsOn(rig, end, joint));
}

/**
 * A copy of the pose whose trunk bends, all its joints about alike, until `end` is at `target` or as near as it gets;
 * `end` keeps its rotation in the world. By cyclic coordinate descent with small steps.
 */
export function lean(rig: Body, pose: Pose, end: number, target: Triple): Pose {
  const chain = trunkBelow(rig, end);
  const kept = turnOf(forward(rig, pose), end);
  const goal = new Vector3(...target);
  let made: Pose = pose.slice();
  for (let round = 0; round < ROUNDS && chain.length > 0; round++) {
    chain.forEach((joint, i) => {
      const globals = forward(rig, made);
      const from = placeOf(globals, joint);
      const now = placeOf(globals, end).sub(from);
      const wanted = goal.clone().sub(from);
      if (now.lengthSq() < 1e-8 || wanted.lengthSq() < 1e-8) return;
      const swing = new Quaternion().setFromUnitVectors(now.normalize(), wanted.normalize());
      const part = new Quaternion().slerp(swing, 1 / (chain.length - i));
      made = withTurn(rig, made, globals, joint, part.multiply(turnOf(globals, joint)));
    });
  }
  return withTurn(rig, made, forward(rig, made), end, kept);
}
