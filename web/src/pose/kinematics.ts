/** Forward kinematics of one row of any rig, and back. */

import { Quaternion, Vector3 } from "three";
import type { Pose, Rig } from "../rig";

export type Skeleton = Pick<Rig, "parents" | "offsets" | "moved">;

/** Where every joint is in the world: (joint, 3) metres, and (joint, 4) how it is turned, as x, y, z, w. */
export interface Globals {
  readonly positions: Float64Array;
  readonly rotations: Float64Array;
}

export type Triple = readonly [number, number, number];

/** Where a joint's rotation starts in a row. */
export const rotationAt = (joint: number): number => 3 + 4 * joint;

/** Where a joint's place starts in a row of a rig whose joints move. */
export const placeAt = (joints: number, joint: number): number => 3 + 4 * joints + 3 * joint;

/** Without a turn, at the origin. */
export function newGlobals(joints: number): Globals {
  return { positions: new Float64Array(3 * joints), rotations: new Float64Array(4 * joints) };
}

const [turn, above, place, origin] = [new Quaternion(), new Quaternion(), new Vector3(), new Vector3()];

/** Global places and rotations of a pose. The root's place is the row's first three floats. */
export function forward(rig: Skeleton, pose: Pose, into = newGlobals(rig.parents.length)): Globals {
  const { positions, rotations } = into;
  rig.parents.forEach((parent, joint) => {
    turn.fromArray(pose, rotationAt(joint)).normalize();
    if (parent < 0) place.fromArray(pose);
    else {
      if (rig.moved) place.fromArray(pose, placeAt(rig.parents.length, joint));
      else place.fromArray(rig.offsets, 3 * joint);
      turn.premultiply(above.fromArray(rotations, 4 * parent));
      place.applyQuaternion(above).add(origin.fromArray(positions, 3 * parent));
    }
    turn.toArray(rotations, 4 * joint);
    place.toArray(positions, 3 * joint);
  });
  return into;
}

/** The places of some joints in frames `first` to `last` (without it) of rows: (frame, joint of the list, 3). */
export function tracks(
  rig: Skeleton,
  rows: Float32Array,
  stride: number,
  joints: readonly number[],
  first = 0,
  last = rows.length / stride,
): Float32Array {
  const found = new Float32Array(Math.max(0, last - first) * joints.length * 3);
  const globals = newGlobals(rig.parents.length);
  let at = 0;
  for (let frame = first; frame < last; frame++) {
    forward(rig, rows.subarray(frame * stride, (frame + 1) * stride), globals);
    for (const joint of joints) {
      for (let i = 0; i < 3; i++) found[at++] = globals.positions[3 * joint + i];
    }
  }
  return found;
}

/** The place of one joint. */
export function placeOf(globals: Globals, joint: number): Vector3 {
  return new Vector3().fromArray(globals.positions, 3 * joint);
}

/** How a joint is turned in the world. */
export function turnOf(globals: Globals, joint: number): Quaternion {
  return new Quaternion().fromArray(globals.rotations, 4 * joint);
}

/** How a joint has to be turned in its parent's frame to be turned by `rotation` in the world. */
export function localRotation(rig: Skeleton, globals: Globals, joint: number, rotation: Quaternion): Quaternion {
  const parent = rig.parents[joint];
  return parent < 0 ? rotation.clone() : turnOf(globals, parent).invert().multiply(rotation);
}

/** The joint that a character is about: its hips, or else its root. Some files keep the root still and move the hips. */
export function hipsOf(rig: Pick<Rig, "humanoid">): number {
  return rig.humanoid.Hips ?? 0;
}

/** Whether a joint is above the hips, and so no part of the body. */
export function aboveHips(rig: Pick<Rig, "humanoid" | "parents">, joint: number): boolean {
  const hips = hipsOf(rig);
  return joint !== hips && hangsOn(rig, hips, joint);
}

/** Whether `joint` hangs on `above`, or is it. */
export function hangsOn(rig: Pick<Rig, "parents">, joint: number, above: number): boolean {
  let at = joint;
  while (at > above) at = rig.parents[at];
  return at === above;
}
