/** An opened rig: what the server told of it, with its arrays, and how wide a pose is. */

import type { Rig as Told } from "./protocol";
import type { Arrays } from "./wire";

/** One row of floats: the root's position, each joint's rotation in its parent's frame, and places where the rig has them. */
export type Pose = Float32Array;

export interface Rig extends Omit<Told, "arrays"> {
  /** Floats of a pose. */
  readonly stride: number;
  /** (joint, 3) places in the parent's frame, metres. */
  readonly offsets: Float32Array;
  /** (frame, stride) rows of the file. */
  readonly frames: Float32Array;
  readonly frameCount: number;
  readonly figure: {
    readonly vertices: Float32Array;
    readonly normals: Float32Array;
    readonly carriers: Float32Array;
    readonly triangles: Float32Array;
    readonly sides: Float32Array;
  };
}

export function rigOf(told: Told, arrays: Arrays): Rig {
  const joints = told.joints.length;
  const stride = 3 + 4 * joints + (told.moved ? 3 * joints : 0);
  const figure = Object.fromEntries(
    ["vertices", "normals", "carriers", "triangles", "sides"].map((name) => [name, arrays[name].values]),
  ) as unknown as Rig["figure"];
  return {
    ...told,
    stride,
    offsets: arrays.offsets.values,
    frames: arrays.frames.values,
    frameCount: arrays.frames.shape[0],
    figure,
  };
}

/** Row `index` of some rows, without a copy. */
export function row(rows: Float32Array, stride: number, index: number): Pose {
  return rows.subarray(index * stride, (index + 1) * stride);
}
