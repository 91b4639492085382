/** Interpolates poses where nothing is generated yet, and compares motion. */

import type { Pose } from "../rig";
import { row } from "../rig";

const ROTATIONS = 3;

/** A pose between two: linear for positions, normalised linear along the shorter arc for rotations. */
export function mix(a: Pose, b: Pose, share: number, joints: number, into: Pose = new Float32Array(a.length)): Pose {
  for (let i = 0; i < a.length; i++) into[i] = a[i] + share * (b[i] - a[i]);
  for (let joint = 0; joint < joints; joint++) {
    const at = ROTATIONS + 4 * joint;
    let dot = 0;
    for (let i = at; i < at + 4; i++) dot += a[i] * b[i];
    const sign = dot < 0 ? -1 : 1;
    let length = 0;
    for (let i = at; i < at + 4; i++) {
      into[i] = a[i] + share * (sign * b[i] - a[i]);
      length += into[i] * into[i];
    }
    length = Math.sqrt(length) || 1;
    for (let i = at; i < at + 4; i++) into[i] /= length;
  }
  return into;
}

/** `count` rows from the pose after `a` to the one before `b`, in even steps. */
export function between(a: Pose, b: Pose, count: number, joints: number): Float32Array {
  const rows = new Float32Array(count * a.length);
  for (let i = 0; i < count; i++) mix(a, b, (i + 1) / (count + 1), joints, row(rows, a.length, i));
  return rows;
}

/** The same motion resampled to another number of frames. */
export function stretched(rows: Float32Array, stride: number, count: number, joints: number): Float32Array {
  const had = rows.length / stride;
  if (had === count || had === 0) return rows;
  const made = new Float32Array(count * stride);
  for (let i = 0; i < count; i++) {
    const at = count === 1 ? (had - 1) / 2 : (i * (had - 1)) / (count - 1);
    const low = Math.floor(at);
    const high = Math.min(low + 1, had - 1);
    mix(row(rows, stride, low), row(rows, stride, high), at - low, joints, row(made, stride, i));
  }
  return made;
}

/** Whether two motions agree within a centimetre and about a degree everywhere. */
export function alike(a: Float32Array, b: Float32Array): boolean {
  if (a === b) return true;
  if (a.length !== b.length) return false;
  for (let i = 0; i < a.length; i++) if (Math.abs(a[i] - b[i]) > 0.01) return false;
  return true;
}
