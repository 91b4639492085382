import { Ray } from "three";
import { describe, expect, it } from "vitest";
import type { Pointer } from "../../../src/viewport/picking/geometry";
import { changing } from "../../../src/viewport/handles/drag";

describe("a dragged pose", () => {
  const at = (x: number): Pointer => ({ x, y: 0, ray: new Ray(), shift: false, slack: 0 });
  const drag = (told: [number, string][]) =>
    changing(
      new Float32Array([7]),
      (pose, phase) => told.push([pose[0], phase]),
      ({ x }) => (x < 0 ? null : new Float32Array([x])),
    );

  it("is told from its start to its end", () => {
    const told: [number, string][] = [];
    const held = drag(told);
    held.move(at(-1));
    held.move(at(1));
    held.move(at(2));
    held.end();
    expect(told).toEqual([
      [1, "start"],
      [2, "drag"],
      [2, "end"],
    ]);
  });

  it("is taken back, and is not told of where nothing moved", () => {
    const told: [number, string][] = [];
    const held = drag(told);
    held.cancel();
    held.end();
    expect(told).toEqual([]);
    held.move(at(3));
    held.cancel();
    expect(told).toEqual([
      [3, "start"],
      [7, "end"],
    ]);
  });
});
