import { describe, expect, it } from "vitest";
import { decalGeometry } from "../../../src/viewport/marks/decals";
import { dotGeometry } from "../../../src/viewport/marks/dots";
import { ribbonGeometry } from "../../../src/viewport/marks/ribbons";

describe("geometries", () => {
  it("of ribbons have two vertices a point, and lines apart", () => {
    const points = [0, 1, 2].map((x) => ({ x, y: 0, z: 0 }));
    const made = ribbonGeometry([
      { points, colour: "#ffffff", width: 2 },
      { points: points.slice(0, 1), colour: "#ffffff", width: 2 },
      { points, colour: "#000000", width: 1 },
    ]);
    expect(made.getAttribute("position").count).toBe(12);
    expect(made.index?.count).toBe(24);
    expect(Math.max(...made.index!.array.slice(0, 12))).toBe(5);
  });

  it("of dots and decals hold what was given", () => {
    const dots = dotGeometry([{ x: 1, y: 2, z: 3, size: 5, colour: "#ff0000", time: 4 }]);
    expect([...dots.getAttribute("position").array]).toEqual([1, 2, 3]);
    expect(dots.getAttribute("time").array[0]).toBe(4);
    const decal = decalGeometry([
      { x: 1, z: 1, angle: Math.PI / 2, width: 1, length: 4, mark: "arrow", colour: "#ffffff" },
    ]);
    const { array } = decal.getAttribute("position");
    expect(array[3 * 2]).toBeCloseTo(3, 5); // the front looks along +X
  });
});
