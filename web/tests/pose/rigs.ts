/** Small rigs and random numbers that the tests of poses share. */

import { Quaternion, Vector3 } from "three";
import type { Pose, Rig } from "../../src/rig";

export type Body = Pick<Rig, "parents" | "offsets" | "moved" | "humanoid" | "stride" | "feet" | "rate" | "size">;

/** The same numbers for the same seed, between 0 and 1 (mulberry32). */
export function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

export function randomTurn(next: () => number, most = Math.PI): Quaternion {
  const axis = new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
  return new Quaternion().setFromAxisAngle(axis, most * next());
}

const JOINTS: readonly [string, string | null, number, number, number][] = [
  ["Hips", null, 0, 0, 0],
  ["LeftUpLeg", "Hips", 0.1, -0.05, 0],
  ["LeftLeg", "LeftUpLeg", 0, -0.43, 0.01],
  ["LeftFoot", "LeftLeg", 0, -0.42, -0.01],
  ["LeftToe", "LeftFoot", 0, -0.07, 0.15],
  ["RightUpLeg", "Hips", -0.1, -0.05, 0],
  ["RightLeg", "RightUpLeg", 0, -0.43, 0.01],
  ["RightFoot", "RightLeg", 0, -0.42, -0.01],
  ["RightToe", "RightFoot", 0, -0.07, 0.15],
  ["Spine", "Hips", 0, 0.1, 0],
  ["Neck", "Spine", 0, 0.4, 0],
  ["Head", "Neck", 0, 0.1, 0],
  ["LeftArm", "Spine", 0.18, 0.35, 0],
  ["LeftTwist", "LeftArm", 0.14, 0, 0],
  ["LeftForeArm", "LeftTwist", 0.14, 0, 0.005],
  ["LeftForeTwist", "LeftForeArm", 0.12, 0.01, 0],
  ["LeftHand", "LeftForeTwist", 0.13, 0, 0],
  ["RightArm", "Spine", -0.18, 0.35, 0],
  ["RightForeArm", "RightArm", -0.28, 0, 0],
  ["RightHand", "RightForeArm", -0.25, 0, 0],
];

/** A humanoid with twist bones in its left arm. */
export function humanoid(moved = false): Body {
  const names = JOINTS.map(([name]) => name);
  const joints = names.length;
  return {
    parents: JOINTS.map(([, parent]) => (parent === null ? -1 : names.indexOf(parent))),
    offsets: new Float32Array(JOINTS.flatMap(([, , ...offset]) => offset)),
    moved,
    humanoid: Object.fromEntries(
      names.filter((name) => !name.includes("Twist")).map((name) => [name, names.indexOf(name)]),
    ),
    stride: 3 + (moved ? 7 : 4) * joints,
    feet: ["LeftFoot", "LeftToe", "RightFoot", "RightToe"].map((name) => ({
      joint: names.indexOf(name),
      height: name.endsWith("Toe") ? 0.02 : 0.09,
    })),
    rate: 30,
    size: 1,
  };
}

/** A pose with its root at a place and every joint turned by up to `most`; of a moved rig with its places stretched. */
export function randomPose(rig: Body, next: () => number, most = 0.8): Pose {
  const pose = new Float32Array(rig.stride);
  const joints = rig.parents.length;
  pose.set([2 * next() - 1, 0.9 + 0.1 * next(), 2 * next() - 1]);
  for (let joint = 0; joint < joints; joint++) pose.set(randomTurn(next, most).toArray(), 3 + 4 * joint);
  if (rig.moved) {
    for (let i = 0; i < 3 * joints; i++)
      pose[3 + 4 * joints + i] = i < 3 ? pose[i] : rig.offsets[i] * (1 + 0.1 * next());
  }
  return pose;
}

/** The pose in which no joint is turned, at a place. */
export function rest(rig: Body, x = 0, y = 0.97, z = 0): Pose {
  const pose = new Float32Array(rig.stride);
  pose.set([x, y, z]);
  for (let joint = 0; joint < rig.parents.length; joint++) pose[3 + 4 * joint + 3] = 1;
  if (rig.moved) pose.set(rig.offsets, 3 + 4 * rig.parents.length);
  if (rig.moved) pose.set([x, y, z], 3 + 4 * rig.parents.length);
  return pose;
}
