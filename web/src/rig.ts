/** An opened rig: the server's message with its arrays. */

import type { Rig as RigMessage } from "./protocol";
import type { Arrays } from "./server/messages";

/** A row of floats: root position, local joint rotations, and joint positions if the rig has them. */
export type Pose = Float32Array;

export interface Rig extends Omit<RigMessage, "arrays"> {
  /** Floats of a pose. */
  readonly stride: number;
  /** (joint, 3) places in the parent's frame, metres. */
  readonly offsets: Float32Array;
  /** (frame, stride) rows of the file. */
  readonly frames: Float32Array;
  readonly frameCount: number;
  readonly character: {
    readonly vertices: Float32Array;
    readonly normals: Float32Array;
    readonly carriers: Float32Array;
    readonly triangles: Float32Array;
    readonly sides: Float32Array;
  };
}

export function rigOf(message: RigMessage, arrays: Arrays): Rig {
  const joints = message.joints.length;
  const stride = 3 + 4 * joints + (message.moved ? 3 * joints : 0);
  const character = Object.fromEntries(
    ["vertices", "normals", "carriers", "triangles", "sides"].map((name) => [name, arrays[name].values]),
  ) as unknown as Rig["character"];
  return {
    ...message,
    stride,
    offsets: arrays.offsets.values,
    frames: arrays.frames.values,
    frameCount: arrays.frames.shape[0],
    character,
  };
}

/** Row `index` of some rows, without a copy. */
export function row(rows: Float32Array, stride: number, index: number): Pose {
  return rows.subarray(index * stride, (index + 1) * stride);
}
