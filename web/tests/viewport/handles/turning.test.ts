import { Quaternion, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { alongTurn, circle, roundTurn, turnedBy, wrapped } from "../../../src/viewport/handles/turning";

describe("turning by rings", () => {
  it("makes circles across an axis", () => {
    const axis = new Vector3(1, 2, -1).normalize();
    for (const point of circle(new Vector3(1, 1, 1), axis, 2, 12)) {
      const arm = point.sub(new Vector3(1, 1, 1));
      expect(arm.length()).toBeCloseTo(2, 9);
      expect(arm.dot(axis)).toBeCloseTo(0, 9);
    }
  });

  it("goes round a ring on the screen, against the clock where its axis looks at the eye", () => {
    const middle = { x: 100, y: 100, visible: true };
    const [right, top] = [
      { x: 150, y: 100, visible: true },
      { x: 100, y: 50, visible: true },
    ];
    expect(roundTurn(middle, right, top, true)).toBeCloseTo(Math.PI / 2, 9);
    expect(roundTurn(middle, right, top, false)).toBeCloseTo(-Math.PI / 2, 9);
  });

  it("goes along a ring that is seen from its edge", () => {
    const [from, to] = [
      { x: 0, y: 0, visible: true },
      { x: 30, y: 40, visible: true },
    ];
    expect(alongTurn({ x: 0, y: 2 }, from, to, 80)).toBeCloseTo(0.5, 9);
  });

  it("wraps angles and turns in the world", () => {
    expect(wrapped(1.5 * Math.PI)).toBeCloseTo(-0.5 * Math.PI, 9);
    const turned = turnedBy(new Quaternion(), new Vector3(0, 1, 0), Math.PI / 2);
    expect(new Vector3(0, 0, 1).applyQuaternion(turned).x).toBeCloseTo(1, 9);
  });
});
