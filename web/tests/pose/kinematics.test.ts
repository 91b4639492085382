import { Quaternion, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { forward, hangsOn, localRotation, placeOf, tracks, turnOf } from "../../src/pose/kinematics";
import { humanoid, random, randomPose } from "./rigs";

const HALF = Math.SQRT1_2;
const chain = { parents: [-1, 0, 1], offsets: new Float32Array([9, 9, 9, 0, 1, 0, 0, 0, 2]), moved: false };

describe("forward kinematics", () => {
  it("follows a chain that was reckoned by hand", () => {
    // The root is turned a quarter about Z: +Y goes to -X. The middle is turned a quarter about X: +Z goes to -Y.
    const pose = new Float32Array([1, 2, 3, 0, 0, HALF, HALF, HALF, 0, 0, HALF, 0, 0, 0, 1]);
    const globals = forward(chain, pose);
    const wanted = [1, 2, 3, 0, 2, 3, 2, 2, 3];
    wanted.forEach((value, i) => expect(globals.positions[i]).toBeCloseTo(value, 6));
    const turn = new Quaternion(0, 0, HALF, HALF).multiply(new Quaternion(HALF, 0, 0, HALF));
    expect(new Quaternion().fromArray(globals.rotations, 8).angleTo(turn)).toBeLessThan(1e-6);
  });

  it("takes the places of a moved rig from the row, and the root's from its start", () => {
    const pose = new Float32Array([1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 7, 7, 7, 0, 3, 0, 0, 0, 5]);
    const globals = forward({ ...chain, moved: true }, pose);
    expect([...globals.positions]).toEqual([1, 0, 0, 1, 3, 0, 1, 3, 5]);
  });

  it("agrees with three.js on random poses", () => {
    const rig = humanoid();
    const next = random(1);
    for (let round = 0; round < 20; round++) {
      const pose = randomPose(rig, next, Math.PI);
      const globals = forward(rig, pose);
      const places: Vector3[] = [];
      const turns: Quaternion[] = [];
      rig.parents.forEach((parent, joint) => {
        const local = new Quaternion().fromArray(pose, 3 + 4 * joint).normalize();
        const offset = new Vector3().fromArray(rig.offsets, 3 * joint);
        places.push(
          parent < 0 ? new Vector3().fromArray(pose) : offset.applyQuaternion(turns[parent]).add(places[parent]),
        );
        turns.push(parent < 0 ? local : turns[parent].clone().multiply(local));
        expect(places[joint].distanceTo(placeOf(globals, joint))).toBeLessThan(1e-6);
      });
    }
  });

  it("is undone by the local rotation", () => {
    const rig = humanoid();
    const pose = randomPose(rig, random(2));
    const globals = forward(rig, pose);
    rig.parents.forEach((_, joint) => {
      const local = localRotation(rig, globals, joint, turnOf(globals, joint));
      expect(local.angleTo(new Quaternion().fromArray(pose, 3 + 4 * joint).normalize())).toBeLessThan(1e-5);
    });
  });

  it("gives the tracks of joints over some frames", () => {
    const rig = humanoid();
    const next = random(3);
    const poses = [randomPose(rig, next), randomPose(rig, next), randomPose(rig, next)];
    const rows = new Float32Array(3 * rig.stride);
    poses.forEach((pose, i) => rows.set(pose, i * rig.stride));
    const found = tracks(rig, rows, rig.stride, [4, 0], 1, 3);
    expect(found.length).toBe(12);
    placeOf(forward(rig, poses[2]), 4).toArray().forEach((value, i) => expect(found[6 + i]).toBeCloseTo(value, 6));
    expect([...found.subarray(3, 6)]).toEqual([...poses[1].subarray(0, 3)]);
  });

  it("knows what hangs on what", () => {
    const rig = humanoid();
    expect(hangsOn(rig, 4, 1)).toBe(true);
    expect(hangsOn(rig, 4, 5)).toBe(false);
    expect(hangsOn(rig, 4, 4)).toBe(true);
    expect(hangsOn(rig, 1, 4)).toBe(false);
  });
});
