import { Ray, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { forward, placeOf } from "../../../src/pose/kinematics";
import type { Rig } from "../../../src/rig";
import { hitBones, onLevel, onPlane, pixelsToPolyline } from "../../../src/viewport/picking/geometry";
import { humanoid, rest } from "../../pose/rigs";

const rig = humanoid() as unknown as Rig;

describe("picking", () => {
  it("measures pixels to a line of spots, and passes over what is not seen", () => {
    const spots = [
      { x: 0, y: 0, visible: true },
      { x: 10, y: 0, visible: true },
      { x: 10, y: 10, visible: false },
    ];
    expect(pixelsToPolyline(spots, 5, 3)).toBe(3);
    expect(pixelsToPolyline(spots, 13, 4)).toBe(5);
    expect(pixelsToPolyline(spots.slice(1), 10, 5)).toBe(Infinity);
  });

  it("hits the nearest bone of a body", () => {
    const globals = forward(rig, rest(rig));
    const knee = placeOf(globals, 2);
    const ray = new Ray(new Vector3(knee.x, knee.y + 0.2, 5), new Vector3(0, 0, -1));
    const hit = hitBones(rig, globals, new Vector3(), ray, 0.08);
    expect(hit?.joint).toBe(1);
    expect(hit?.distance).toBeCloseTo(5, 1);
    expect(hitBones(rig, globals, new Vector3(3, 0, 0), ray, 0.08)).toBeNull();
  });

  it("does not hit what lies above the hips", () => {
    const above = { parents: [-1, 0, 1], humanoid: { Hips: 1 } };
    const globals = { positions: new Float64Array([0, 0, 0, 0, 1, -4, 0, 2, -4]), rotations: new Float64Array(12) };
    const ray = new Ray(new Vector3(5, 0.5, -2), new Vector3(-1, 0, 0));
    expect(hitBones(above, globals, new Vector3(), ray, 0.1)).toBeNull();
    expect(
      hitBones(above, globals, new Vector3(), new Ray(new Vector3(5, 1.5, -4), new Vector3(-1, 0, 0)), 0.1)?.joint,
    ).toBe(1);
  });

  it("meets the ground and planes", () => {
    const ray = new Ray(new Vector3(0, 2, 0), new Vector3(0, -1, 1).normalize());
    expect(
      onLevel(ray, 0)
        ?.toArray()
        .map((v) => Math.round(v * 1e6) / 1e6),
    ).toEqual([0, 0, 2]);
    expect(onLevel(ray, 3)).toBeNull();
    expect(onLevel(ray, 0, 1)).toBeNull();
    expect(onPlane(ray, new Vector3(0, 0, -1), new Vector3(0, 0, 1))?.y).toBeCloseTo(1, 6);
  });
});
