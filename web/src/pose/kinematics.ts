/** Forward kinematics of one row of any rig, and back. */

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

/** Global places and rotations of a pose. The root's place is the row's first three floats. */
export function forward(rig: Skeleton, pose: Pose, into?: Globals): Globals {
  const joints = rig.parents.length;
  const out = into ?? { positions: new Float64Array(3 * joints), rotations: new Float64Array(4 * joints) };
  const { positions: p, rotations: r } = out;
  for (let joint = 0; joint < joints; joint++) {
    const parent = rig.parents[joint];
    const q = rotationAt(joint);
    const norm = Math.hypot(pose[q], pose[q + 1], pose[q + 2], pose[q + 3]) || 1;
    const x = pose[q] / norm;
    const y = pose[q + 1] / norm;
    const z = pose[q + 2] / norm;
    const w = pose[q + 3] / norm;
    if (parent < 0) {
      for (let i = 0; i < 3; i++) p[3 * joint + i] = pose[i];
      r[4 * joint] = x;
      r[4 * joint + 1] = y;
      r[4 * joint + 2] = z;
      r[4 * joint + 3] = w;
      continue;
    }
    const px = r[4 * parent];
    const py = r[4 * parent + 1];
    const pz = r[4 * parent + 2];
    const pw = r[4 * parent + 3];
    r[4 * joint] = pw * x + px * w + py * z - pz * y;
    r[4 * joint + 1] = pw * y - px * z + py * w + pz * x;
    r[4 * joint + 2] = pw * z + px * y - py * x + pz * w;
    r[4 * joint + 3] = pw * w - px * x - py * y - pz * z;
    const from = rig.moved ? pose : rig.offsets;
    const at = rig.moved ? placeAt(joints, joint) : 3 * joint;
    const ox = from[at];
    const oy = from[at + 1];
    const oz = from[at + 2];
    const tx = 2 * (py * oz - pz * oy);
    const ty = 2 * (pz * ox - px * oz);
    const tz = 2 * (px * oy - py * ox);
    p[3 * joint] = p[3 * parent] + ox + pw * tx + py * tz - pz * ty;
    p[3 * joint + 1] = p[3 * parent + 1] + oy + pw * ty + pz * tx - px * tz;
    p[3 * joint + 2] = p[3 * parent + 2] + oz + pw * tz + px * ty - py * tx;
  }
  return out;
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
  const globals = {
    positions: new Float64Array(3 * rig.parents.length),
    rotations: new Float64Array(4 * rig.parents.length),
  };
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
export function placeOf(globals: Globals, joint: number): [number, number, number] {
  const at = 3 * joint;
  return [globals.positions[at], globals.positions[at + 1], globals.positions[at + 2]];
}

/** How a joint has to be turned in its parent's frame to be turned by `rotation` in the world. */
export function localRotation(
  rig: Skeleton,
  globals: Globals,
  joint: number,
  rotation: readonly [number, number, number, number],
): [number, number, number, number] {
  const parent = rig.parents[joint];
  const [x, y, z, w] = rotation;
  if (parent < 0) return [x, y, z, w];
  const a = -globals.rotations[4 * parent];
  const b = -globals.rotations[4 * parent + 1];
  const c = -globals.rotations[4 * parent + 2];
  const d = globals.rotations[4 * parent + 3];
  return [
    d * x + a * w + b * z - c * y,
    d * y - a * z + b * w + c * x,
    d * z + a * y - b * x + c * w,
    d * w - a * x - b * y - c * z,
  ];
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
