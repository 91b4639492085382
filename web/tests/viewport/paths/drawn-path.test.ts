import { describe, expect, it } from "vitest";
import { controlPoints } from "../../../src/viewport/paths/drawn-path";

describe("strokes", () => {
  const ends = { from: [0, 0], to: [4, 0] } as const;

  it("become few control points that stay clear of the ends", () => {
    const stroke = Array.from({ length: 120 }, (_, i): [number, number] => [i / 30, Math.sin((i / 119) * Math.PI)]);
    const points = controlPoints(stroke, ends, 1);
    expect(points.length).toBeGreaterThan(1);
    expect(points.length).toBeLessThan(10);
    for (const [x, z] of points) expect(Math.min(Math.hypot(x, z), Math.hypot(x - 4, z))).toBeGreaterThan(0.19);
  });

  it("that are straight keep one point, so that they are a line and not none", () => {
    const stroke = Array.from({ length: 40 }, (_, i): [number, number] => [i / 10, 0]);
    expect(controlPoints(stroke, ends, 1)).toEqual([[2, 0]]);
    expect(controlPoints([[0, 0]], ends, 1)).toEqual([]);
  });
});
