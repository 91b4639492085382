/** A rig of three joints for tests, and poses on it. */

import type { GapSettings } from "../src/protocol";
import type { Pose, Rig } from "../src/rig";
import { DEFAULT_SETTINGS, type Document, type Key } from "../src/document/document";

const JOINTS = 3;
export const STRIDE = 3 + 4 * JOINTS;

export function pose(x: number, height = 1): Pose {
  const made = new Float32Array(STRIDE);
  made[0] = x;
  made[1] = height;
  for (let joint = 0; joint < JOINTS; joint++) made[3 + 4 * joint + 3] = 1;
  return made;
}

/** A rig whose clip moves along x by a centimetre a frame. */
export function rig(frameCount = 100): Rig {
  const frames = new Float32Array(frameCount * STRIDE);
  for (let frame = 0; frame < frameCount; frame++) frames.set(pose(frame / 100), frame * STRIDE);
  const none = new Float32Array(0);
  return {
    id: "rig", name: "walk.bvh", rate: 30, joints: ["a", "b", "c"], parents: [-1, 0, 1], moved: false, profile: null,
    reason: null, humanoid: {}, feet: [], size: 1, stride: STRIDE, offsets: new Float32Array(9), frames, frameCount,
    character: { vertices: none, normals: none, carriers: none, triangles: none, sides: none },
  };
}

/** A document with generated gaps and keys at some frames, their ids `k0`, `k45`, ... */
export function keyed(frames: readonly number[], after: Partial<GapSettings> = {}): Document {
  const keys = frames.map((frame): Key => ({
    id: `k${frame}`, frame, pose: pose(frame / 100), source: null, after: { ...DEFAULT_SETTINGS, ...after }, kept: null,
  }));
  return { name: "test", source: { name: "walk.bvh", text: "" }, rate: 30, stride: STRIDE, keys };
}
