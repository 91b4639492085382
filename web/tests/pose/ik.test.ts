import { Quaternion, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { LIMBS, limbAt, limbOf, moveHips, reach, shifted, turnMiddle, type Limb } from "../../src/pose/ik";
import { forward, placeOf, turnOf } from "../../src/pose/kinematics";
import type { Pose } from "../../src/rig";
import { humanoid, random, randomPose, randomTurn, rest, type Body } from "./rigs";

function place(rig: Body, pose: Pose, joint: number): Vector3 {
  return placeOf(forward(rig, pose), joint);
}

function lengths(rig: Body, pose: Pose, limb: Limb): [number, number] {
  const mid = place(rig, pose, limb.mid);
  return [mid.distanceTo(place(rig, pose, limb.upper)), mid.distanceTo(place(rig, pose, limb.end))];
}

/** A place within the limb's reach. */
function within(rig: Body, pose: Pose, limb: Limb, next: () => number): Vector3 {
  const [a, b] = lengths(rig, pose, limb);
  const far = Math.abs(a - b) + 0.02 + (a + b - Math.abs(a - b) - 0.04) * next();
  return new Vector3(0, 0, far).applyQuaternion(randomTurn(next)).add(place(rig, pose, limb.upper));
}

describe.each([false, true])("two-bone inverse kinematics (rig moved: %s)", (moved) => {
  const rig = humanoid(moved);
  const limbs = LIMBS.map((name) => limbOf(rig, name)!);

  it("reaches, keeps every bone's length and the end's rotation, and leaves the rest alone", () => {
    const next = random(7);
    for (let round = 0; round < 100; round++) {
      const pose = randomPose(rig, next);
      const held = pose.slice();
      const limb = limbs[round % 4];
      const target = within(rig, pose, limb, next);
      const made = reach(rig, pose, limb, target.toArray());
      expect(pose).toEqual(held);
      expect(place(rig, made, limb.end).distanceTo(target)).toBeLessThan(1e-4);
      const [a, b] = lengths(rig, made, limb);
      const [c, d] = lengths(rig, pose, limb);
      expect(Math.abs(a - c) + Math.abs(b - d)).toBeLessThan(1e-5);
      const [before, after] = [forward(rig, pose), forward(rig, made)];
      expect(turnOf(after, limb.end).angleTo(turnOf(before, limb.end))).toBeLessThan(1e-3);
      for (let i = 0; i < made.length; i++) {
        const joint = Math.floor((i - 3) / 4);
        const free = i >= 3 && [limb.upper, limb.mid, limb.end].includes(joint);
        if (!free) expect(made[i]).toBe(pose[i]);
      }
    }
  });

  it("takes a rotation for the end", () => {
    const next = random(8);
    const pose = randomPose(rig, next);
    const turn = randomTurn(next);
    const made = reach(rig, pose, limbs[0], within(rig, pose, limbs[0], next).toArray(), turn);
    expect(turnOf(forward(rig, made), limbs[0].end).angleTo(turn)).toBeLessThan(1e-3);
  });

  it("stretches straight towards what is out of reach, and folds towards what is too near", () => {
    const next = random(9);
    for (let round = 0; round < 40; round++) {
      const pose = randomPose(rig, next);
      const limb = limbs[round % 4];
      const [a, b] = lengths(rig, pose, limb);
      const upper = place(rig, pose, limb.upper);
      const way = new Vector3(0, 0, 1).applyQuaternion(randomTurn(next));
      const far = place(rig, reach(rig, pose, limb, upper.clone().addScaledVector(way, 3).toArray()), limb.end);
      expect(far.distanceTo(upper.clone().addScaledVector(way, a + b))).toBeLessThan(1e-4);
      const near = upper.clone().addScaledVector(way, 0.5 * Math.abs(a - b));
      const folded = place(rig, reach(rig, pose, limb, near.toArray()), limb.end);
      expect(folded.distanceTo(upper)).toBeCloseTo(Math.abs(a - b), 4);
      const nowhere = reach(rig, pose, limb, upper.toArray());
      expect(nowhere.every(Number.isFinite)).toBe(true);
    }
  });

  it("keeps the plane in which the limb bends when the target lies in it", () => {
    const pose = randomPose(rig, random(10));
    const limb = limbs[0];
    const [upper, mid, end] = [limb.upper, limb.mid, limb.end].map((joint) => place(rig, pose, joint));
    const normal = mid.clone().sub(upper).cross(end.clone().sub(mid)).normalize();
    const target = upper.clone().add(end.clone().sub(upper).multiplyScalar(0.8).applyAxisAngle(normal, 0.4));
    const made = reach(rig, pose, limb, target.toArray());
    const bent = place(rig, made, limb.mid)
      .sub(upper)
      .cross(target.clone().sub(place(rig, made, limb.mid)));
    expect(bent.normalize().dot(normal)).toBeGreaterThan(0.9999);
  });

  it("changes nothing where the end already is", () => {
    const pose = randomPose(rig, random(11));
    for (const limb of limbs) {
      const made = reach(rig, pose, limb, place(rig, pose, limb.end).toArray());
      const [before, after] = [forward(rig, pose), forward(rig, made)];
      expect(turnOf(before, limb.upper).angleTo(turnOf(after, limb.upper))).toBeLessThan(2e-3);
    }
  });

  it("bends straight knees forward and straight elbows backward", () => {
    const straight = rest(rig);
    for (const name of LIMBS) {
      const limb = limbOf(rig, name)!;
      const flat = { ...rig, offsets: rig.offsets.slice() };
      for (const joint of [limb.mid, limb.end]) flat.offsets[3 * joint + 2] = 0;
      if (!moved) {
        const end = place(flat, straight, limb.end);
        const upper = place(flat, straight, limb.upper);
        const goal = upper.clone().lerp(end, 0.8);
        const made = reach(flat, straight, limb, goal.toArray());
        const mid = place(flat, made, limb.mid);
        if (name.endsWith("Leg")) expect(mid.z).toBeGreaterThan(0.05);
        else if (name === "RightArm") expect(mid.z).toBeLessThan(-0.05);
        expect(place(flat, made, limb.end).distanceTo(goal)).toBeLessThan(1e-4);
      }
    }
  });

  it("moves the hips over feet that stay where and as they are", () => {
    const next = random(12);
    for (let round = 0; round < 20; round++) {
      const pose = randomPose(rig, next, 0.3);
      const before = forward(rig, pose);
      const hips = placeOf(before, 0).toArray();
      const target = [hips[0] + 0.05 * next(), hips[1] - 0.15, hips[2] - 0.05 * next()] as const;
      const made = moveHips(rig, pose, target);
      const after = forward(rig, made);
      placeOf(after, 0).toArray().forEach((value, i) => expect(value).toBeCloseTo(target[i], 5));
      for (const limb of limbs.slice(2)) {
        const [from, to] = [place(rig, pose, limb.end), place(rig, made, limb.end)];
        expect(to.distanceTo(from)).toBeLessThan(1e-4);
        expect(turnOf(after, limb.end).angleTo(turnOf(before, limb.end))).toBeLessThan(1e-3);
      }
    }
  });

  it("turns a knee about the leg's line without moving the foot", () => {
    const pose = reach(rig, rest(rig), limbs[2], [0.1, 0.3, 0.1]);
    const made = turnMiddle(rig, pose, limbs[2], [1, 0.5, 0.1]);
    expect(place(rig, made, limbs[2].mid).x).toBeGreaterThan(place(rig, pose, limbs[2].mid).x + 0.1);
    expect(place(rig, made, limbs[2].end).distanceTo(place(rig, pose, limbs[2].end))).toBeLessThan(1e-4);
    const [before, after] = [forward(rig, pose), forward(rig, made)];
    expect(turnOf(after, limbs[2].end).angleTo(turnOf(before, limbs[2].end))).toBeLessThan(1e-3);
  });

  it("moves the root's own place along", () => {
    const made = shifted(rig, rest(rig, 1, 2, 3), [1, 0, -1]);
    expect([...made.subarray(0, 3)]).toEqual([2, 2, 2]);
    if (moved)
      expect([...made.subarray(rig.stride - 3 * rig.parents.length, rig.stride - 3 * rig.parents.length + 3)]).toEqual([
        2, 2, 2,
      ]);
  });
});

describe("limbs", () => {
  const rig = humanoid();

  it("are found by the joints of the humanoid", () => {
    const arm = limbOf(rig, "LeftArm");
    expect([arm?.upper, arm?.mid, arm?.end]).toEqual([12, 14, 16]);
    expect(limbAt(rig, 16)?.part).toBe("end");
    expect(limbAt(rig, 2)).toMatchObject({ part: "mid", limb: { upper: 1 } });
    expect(limbAt(rig, 0)).toBeNull();
  });

  it("are none where joints are missing or do not hang together", () => {
    const { LeftHand: _, ...without } = rig.humanoid;
    expect(limbOf({ ...rig, humanoid: without }, "LeftArm")).toBeNull();
    expect(limbOf({ ...rig, humanoid: { ...rig.humanoid, LeftHand: 19 } }, "LeftArm")).toBeNull();
    expect(limbOf({ ...rig, humanoid: {} }, "RightLeg")).toBeNull();
  });

  it("turn by quaternions of length one", () => {
    const pose = randomPose(rig, random(20));
    const made = reach(rig, pose, limbOf(rig, "LeftLeg")!, [0, 0, 0]);
    expect(new Quaternion().fromArray(made, 3 + 4 * 1).length()).toBeCloseTo(1, 5);
  });
});
