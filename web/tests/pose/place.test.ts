import { describe, expect, it } from "vitest";
import { forward, placeOf } from "../../src/pose/kinematics";
import { groundOf, headingOf, moveOnGround, turnAboutHips } from "../../src/pose/place";
import { humanoid, random, randomPose, rest } from "./rigs";

describe.each([false, true])("placing a pose (rig moved: %s)", (moved) => {
  const rig = humanoid(moved);

  it("moves all joints alike", () => {
    const pose = randomPose(rig, random(1));
    const [before, after] = [forward(rig, pose), forward(rig, moveOnGround(rig, pose, 0.5, -2))];
    before.positions.forEach((value, i) => expect(after.positions[i]).toBeCloseTo(value + [0.5, 0, -2][i % 3], 5));
  });

  it("turns about the vertical through the hips", () => {
    const pose = rest(rig, 2, 0.97, 1);
    const made = turnAboutHips(rig, pose, Math.PI / 2);
    const after = forward(rig, made);
    expect(groundOf(rig, made)[0]).toBeCloseTo(2, 5);
    expect(groundOf(rig, made)[1]).toBeCloseTo(1, 5);
    const toe = placeOf(after, 4).toArray(); // was .1 to the left and .15 ahead: ahead is +X now, left is -Z
    expect(toe[0]).toBeCloseTo(2.15, 4);
    expect(toe[2]).toBeCloseTo(0.9, 4);
  });

  it("keeps the hips' place where the root is another joint", () => {
    const other = { ...rig, humanoid: { ...rig.humanoid, Hips: 9 } };
    const pose = randomPose(rig, random(2));
    const [x, z] = groundOf(other, pose);
    const after = groundOf(other, turnAboutHips(other, pose, 1.2));
    expect(after[0]).toBeCloseTo(x, 5);
    expect(after[1]).toBeCloseTo(z, 5);
  });

  it("knows where a pose looks", () => {
    expect(headingOf(rig, rest(rig))).toBeCloseTo(0, 6);
    expect(headingOf(rig, turnAboutHips(rig, rest(rig), 0.7))).toBeCloseTo(0.7, 5);
    const { LeftUpLeg: _, ...without } = rig.humanoid;
    expect(headingOf({ ...rig, humanoid: without }, turnAboutHips(rig, rest(rig), -1.1))).toBeCloseTo(-1.1, 5);
  });
});
