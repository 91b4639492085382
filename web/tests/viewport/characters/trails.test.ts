import { describe, expect, it } from "vitest";
import type { Rig } from "../../../src/rig";
import { drawnFrames, trailed } from "../../../src/viewport/characters/trails";
import { humanoid } from "../../pose/rigs";

const rig = humanoid() as unknown as Rig;

describe("what is drawn of a motion", () => {
  it("is trails of hands, feet and hips, or of the ends of another rig", () => {
    expect(trailed(rig).map(({ joint }) => joint)).toEqual([0, 16, 4, 19, 8]);
    const other = { ...rig, humanoid: {}, parents: [-1, 0, 1, 0] };
    expect(trailed(other).map(({ joint }) => joint)).toEqual([0, 2, 3]);
  });

  it("is whole blocks of frames around the playhead", () => {
    expect(drawnFrames(100, 1000, 30)).toEqual([30, 151]);
    expect(drawnFrames(104, 1000, 30)).toEqual([30, 151]);
    expect(drawnFrames(0, 20, 30)).toEqual([0, 20]);
    for (const at of [0, 17, 45, 203]) {
      const [first, last] = drawnFrames(at, 1000, 30);
      expect(first).toBeLessThanOrEqual(Math.max(0, at - 45));
      expect(last).toBeGreaterThan(at + 45);
    }
  });
});
