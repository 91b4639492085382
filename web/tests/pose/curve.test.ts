import { describe, expect, it } from "vitest";
import { curve, distance, inserted, nearest, thinned, type Ground } from "../../src/pose/curve";
import { random } from "./rigs";

describe("curves", () => {
  it("pass through their points", () => {
    const next = random(4);
    for (let round = 0; round < 20; round++) {
      const points = Array.from({ length: 6 }, (): Ground => [4 * next(), 4 * next()]);
      const made = curve(points, 10);
      expect(made.length).toBe(51);
      points.forEach((point, i) => expect(distance(made[10 * i], point)).toBeLessThan(1e-9));
      expect(made.flat().every(Number.isFinite)).toBe(true);
    }
  });

  it("are straight between two points and along a line", () => {
    for (const [x, z] of curve(
      [
        [0, 0],
        [2, 1],
      ],
      8,
    ))
      expect(z).toBeCloseTo(x / 2, 9);
    for (const [x, z] of curve(
      [
        [0, 0],
        [1, 1],
        [5, 5],
      ],
      8,
    ))
      expect(z).toBeCloseTo(x, 9);
  });

  it("do without points that coincide", () => {
    const made = curve(
      [
        [0, 0],
        [0, 0],
        [1, 0],
        [1, 0],
      ],
      4,
    );
    expect(made.length).toBe(5);
    expect(
      curve([
        [1, 1],
        [1, 1],
      ]),
    ).toEqual([[1, 1]]);
    expect(curve([])).toEqual([]);
  });

  it("turn smoothly at their points", () => {
    const made = curve(
      [
        [0, 0],
        [1, 0],
        [1, 1],
        [2, 1],
      ],
      200,
    );
    for (const at of [200, 400]) {
      const [a, b, c] = [made[at - 1], made[at], made[at + 1]];
      const turn = Math.atan2(c[1] - b[1], c[0] - b[0]) - Math.atan2(b[1] - a[1], b[0] - a[0]);
      expect(Math.abs(turn)).toBeLessThan(0.05);
    }
  });

  it("are met where they are nearest", () => {
    expect(
      nearest(
        [
          [0, 0],
          [2, 0],
          [2, 2],
        ],
        [1, 0.5],
      ),
    ).toEqual({ distance: 0.5, after: 0, place: [1, 0] });
    expect(
      nearest(
        [
          [0, 0],
          [2, 0],
          [2, 2],
        ],
        [3, 1],
      ).after,
    ).toBe(1);
  });

  it("take a new point into the nearest stretch, without leaving their course there", () => {
    const [from, to]: [Ground, Ground] = [
      [0, 0],
      [3, 0],
    ];
    const points: Ground[] = [
      [1, 1],
      [2, 1],
    ];
    const made = inserted(from, points, to, [1.5, 1.4]);
    expect(made.at).toBe(1);
    expect(made.points.length).toBe(3);
    expect(made.points[0]).toEqual([1, 1]);
    expect(nearest(curve([from, ...points, to], 24), made.points[1]).distance).toBeLessThan(1e-9);
    expect(inserted(from, points, to, [0.4, 0.4]).at).toBe(0);
    expect(inserted(from, points, to, [2.8, 0.2]).at).toBe(2);
    expect(inserted(from, [], to, [1, 0.2])).toEqual({ points: [[1, 0]], at: 0 });
  });

  it("are thinned within a tolerance", () => {
    const stroke = Array.from({ length: 200 }, (_, i): Ground => [i / 50, Math.sin(i / 30)]);
    const few = thinned(stroke, 0.02);
    expect(few.length).toBeLessThan(20);
    expect(few[0]).toEqual(stroke[0]);
    expect(few[few.length - 1]).toEqual(stroke[199]);
    for (const point of stroke) expect(nearest(few, point).distance).toBeLessThanOrEqual(0.02 + 1e-9);
    expect(
      thinned(
        [
          [0, 0],
          [1, 0],
          [2, 0],
        ],
        0.01,
      ),
    ).toEqual([
      [0, 0],
      [2, 0],
    ]);
    expect(thinned([[0, 0]], 1)).toEqual([[0, 0]]);
  });
});
