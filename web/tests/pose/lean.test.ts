import { describe, expect, it } from "vitest";
import { forward, placeOf, turnOf } from "../../src/pose/kinematics";
import { lean, trunkBelow } from "../../src/pose/lean";
import { humanoid, random, randomPose, rest } from "./rigs";

const rig = humanoid();
const head = rig.humanoid.Head;

describe("leaning", () => {
  it("bends what carries the head", () => {
    expect(trunkBelow(rig, head)).toEqual([rig.humanoid.Spine, rig.humanoid.Neck]);
    expect(trunkBelow(rig, rig.humanoid.Neck)).toEqual([rig.humanoid.Spine]);
    expect(trunkBelow({ ...rig, humanoid: {} }, head)).toEqual([]);
  });

  it("brings the head to its target, keeps its rotation, and leaves hips and legs alone", () => {
    const pose = rest(rig);
    const target = [0.12, 1.5, 0.15] as const;
    const made = lean(rig, pose, head, target);
    const [before, after] = [forward(rig, pose), forward(rig, made)];
    placeOf(after, head).toArray().forEach((value, i) => expect(value).toBeCloseTo(target[i], 1));
    expect(turnOf(after, head).angleTo(turnOf(before, head))).toBeLessThan(1e-3);
    expect([...made.subarray(0, 3 + 4 * 9)]).toEqual([...pose.subarray(0, 3 + 4 * 9)]);
  });

  it("comes nearer to any target, and stays where it is there already", () => {
    const next = random(5);
    for (let round = 0; round < 20; round++) {
      const pose = randomPose(rig, next, 0.4);
      const at = placeOf(forward(rig, pose), head).toArray();
      const target = at.map((value) => value + 0.4 * (next() - 0.5)) as [number, number, number];
      const away = (place: readonly number[]): number => Math.hypot(...place.map((value, i) => value - target[i]));
      expect(away(placeOf(forward(rig, lean(rig, pose, head, target)), head).toArray())).toBeLessThan(away(at));
      const still = placeOf(forward(rig, lean(rig, pose, head, at)), head).toArray();
      expect(Math.hypot(...still.map((value, i) => value - at[i]))).toBeLessThan(1e-3);
    }
  });
});
