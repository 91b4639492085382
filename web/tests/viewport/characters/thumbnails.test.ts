import { describe, expect, it } from "vitest";
import { moveOnGround, turnAboutHips } from "../../../src/pose/place";
import type { Rig } from "../../../src/rig";
import { mixed, silhouettes } from "../../../src/viewport/characters/thumbnails";
import { humanoid, rest } from "../../pose/rigs";

const rig = humanoid() as unknown as Rig;

/** A walk of the rest pose along a way. */
function walk(frames: number, x: number, z: number): Float32Array {
  const rows = new Float32Array(frames * rig.stride);
  for (let i = 0; i < frames; i++)
    rows.set(rest(rig, (x * i) / (frames - 1), 0.97, (z * i) / (frames - 1)), i * rig.stride);
  return rows;
}

describe("thumbnails", () => {
  it("show characters along the way, from left to right", () => {
    const characters = silhouettes(rig, walk(60, 3, 0), 60);
    expect(characters.length).toBe(6);
    expect(characters[5][0].x - characters[0][0].x).toBeCloseTo(3, 4);
    const turned = turnAboutHips(rig, rest(rig), Math.PI / 2); // it looks along +X: its left is farther from the eye
    const rows = new Float32Array([...turned, ...moveOnGround(rig, turned, 2, 0)]);
    const [one] = silhouettes(rig, rows, 2);
    expect(one[5].near - one[1].near).toBeCloseTo(0.2, 4);
  });

  it("spread characters that stay in place", () => {
    const characters = silhouettes(rig, walk(10, 0, 0.01), 10);
    expect(characters[5][0].x - characters[0][0].x).toBeGreaterThan(1);
    expect(silhouettes(rig, walk(2, 0, 1), 1).length).toBe(1);
  });

  it("mix colours", () => {
    expect(mixed("#000000", "#ffffff", 0.5)).toBe("#808080");
  });
});
