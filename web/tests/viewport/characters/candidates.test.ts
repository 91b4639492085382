import { describe, expect, it } from "vitest";
import type { Rig } from "../../../src/rig";
import { hueOf, shiftOf } from "../../../src/viewport/characters/candidates";
import { palettes } from "../../../src/viewport/scene/palette";
import { humanoid, rest } from "../../pose/rigs";

const rig = humanoid() as unknown as Rig;

/** A walk of the rest pose along a way. */
function walk(frames: number, x: number, z: number): Float32Array {
  const rows = new Float32Array(frames * rig.stride);
  for (let i = 0; i < frames; i++)
    rows.set(rest(rig, (x * i) / (frames - 1), 0.97, (z * i) / (frames - 1)), i * rig.stride);
  return rows;
}

describe("candidates", () => {
  const views = [0, 1, 2].map((i) => ({ rows: walk(10, 0, 3), frames: 10, chosen: i === 1 }));

  it("stand side by side across their way, with the chosen one in place", () => {
    expect(shiftOf(rig, views, "side by side", 1).length()).toBe(0);
    const [before, after] = [shiftOf(rig, views, "side by side", 0), shiftOf(rig, views, "side by side", 2)];
    expect(before.z).toBeCloseTo(0, 9);
    expect(before.x).toBeCloseTo(-after.x, 9);
    expect(Math.abs(after.x)).toBeGreaterThan(1);
    expect(shiftOf(rig, views, "overlaid", 2).length()).toBe(0);
  });

  it("have each their own colour, and the chosen one the accent", () => {
    expect(hueOf(views, 1, palettes.light)).toBe(palettes.light.accent);
    expect(hueOf(views, 0, palettes.light)).not.toBe(hueOf(views, 2, palettes.light));
  });
});
