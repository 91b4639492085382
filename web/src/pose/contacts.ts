/** Which foot joints stand and which slide in each frame. */

import type { Rig } from "../rig";
import { hangsOn, tracks, type Skeleton } from "./kinematics";

export const AIR = 0;
export const STANDS = 1;
export const SLIDES = 2;
type ContactState = typeof AIR | typeof STANDS | typeof SLIDES;

/** For a character whose hips are a metre high; heights and speeds grow with the rig. */
const LOW = 0.025;
const STILL = 0.15;
const SLIDING = 0.2;
const SWINGING = 1.2;

type Feet = Skeleton & Pick<Rig, "feet" | "rate" | "size" | "stride">;

export interface Contacts {
  /** (frame, foot joint) in the order of the rig's feet. */
  readonly states: Uint8Array;
  /** (frame, foot joint, 3), metres. */
  readonly places: Float32Array;
  readonly frames: number;
  readonly feet: number;
}

/** The state of a foot joint at `height` above its resting height, moving with `speed`. */
export function contactState(height: number, speed: number, size: number): ContactState {
  if (height > LOW * size) return AIR;
  if (speed < STILL * size) return STANDS;
  return speed > SLIDING * size && speed < SWINGING * size ? SLIDES : AIR;
}

export function contacts(rig: Feet, rows: Float32Array, first = 0, last = rows.length / rig.stride): Contacts {
  const count = rows.length / rig.stride;
  const from = Math.max(0, first - 1);
  const to = Math.min(count, last + 1);
  const feet = rig.feet.length;
  const joints = rig.feet.map(({ joint }) => joint);
  const wide = tracks(rig, rows, rig.stride, joints, from, to);
  const frames = Math.max(0, last - first);
  const states = new Uint8Array(frames * feet);
  for (let frame = 0; frame < frames; frame++) {
    const here = frame + first - from;
    const before = Math.max(0, here - 1);
    const after = Math.min(to - from - 1, here + 1);
    for (let foot = 0; foot < feet; foot++) {
      const [a, b] = [3 * (before * feet + foot), 3 * (after * feet + foot)];
      const length = Math.hypot(wide[b] - wide[a], wide[b + 1] - wide[a + 1], wide[b + 2] - wide[a + 2]);
      const speed = after > before ? (length * rig.rate) / (after - before) : 0;
      const height = wide[3 * (here * feet + foot) + 1] - rig.feet[foot].height;
      states[frame * feet + foot] = contactState(height, speed, rig.size);
    }
  }
  const start = 3 * feet * (first - from);
  return { states, places: wide.slice(start, start + 3 * feet * frames), frames, feet };
}

/** The joints of the feet, foot by foot, as places in the rig's list: the ankle first, then what hangs on it. */
export function footGroups(rig: Pick<Rig, "feet" | "parents">): number[][] {
  const groups: number[][] = [];
  const order = rig.feet.map((_, i) => i).sort((a, b) => rig.feet[a].joint - rig.feet[b].joint);
  for (const i of order) {
    const group = groups.find(([top]) => hangsOn(rig, rig.feet[i].joint, rig.feet[top].joint));
    if (group) group.push(i);
    else groups.push([i]);
  }
  return groups;
}
