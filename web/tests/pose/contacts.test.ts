import { describe, expect, it } from "vitest";
import { AIR, contacts, footGroups, contactState, SLIDES, STANDS } from "../../src/pose/contacts";
import { humanoid, rest } from "./rigs";

const rig = humanoid();
const height = 0.05 + 0.43 + 0.42 + 0.09;

/** Rows of the rest pose, frame by frame at a place. */
function rows(places: readonly [number, number][]): Float32Array {
  const made = new Float32Array(places.length * rig.stride);
  places.forEach(([y, z], i) => made.set(rest(rig, 0, y, z), i * rig.stride));
  return made;
}

describe("contacts", () => {
  it("judge height and speed", () => {
    expect(contactState(0.01, 0.1, 1)).toBe(STANDS);
    expect(contactState(0.01, 0.5, 1)).toBe(SLIDES);
    expect(contactState(0.01, 2, 1)).toBe(AIR);
    expect(contactState(0.1, 0, 1)).toBe(AIR);
    expect(contactState(0.04, 0.2, 2)).toBe(STANDS);
  });

  it("find feet that stand, slide, and swing", () => {
    const still = contacts(
      rig,
      rows([
        [height, 0],
        [height, 0],
        [height, 0],
      ]),
    );
    expect([...still.states]).toEqual(Array(12).fill(STANDS));
    const slid = contacts(
      rig,
      rows([
        [height, 0],
        [height, 0.02],
        [height, 0.04],
      ]),
    );
    expect([...slid.states]).toEqual(Array(12).fill(SLIDES));
    const fast = contacts(
      rig,
      rows([
        [height, 0],
        [height, 0.1],
        [height, 0.2],
      ]),
    );
    expect([...fast.states]).toEqual(Array(12).fill(AIR));
    const high = contacts(
      rig,
      rows([
        [height + 0.2, 0],
        [height + 0.2, 0],
      ]),
    );
    expect([...high.states]).toEqual(Array(8).fill(AIR));
  });

  it("of some frames are those of all", () => {
    const motion = rows([
      [height, 0],
      [height, 0],
      [height, 0.03],
      [height, 0.06],
      [height + 0.1, 0.06],
    ]);
    const all = contacts(rig, motion);
    const some = contacts(rig, motion, 2, 4);
    expect([...some.states]).toEqual([...all.states.slice(8, 16)]);
    expect([...some.places]).toEqual([...all.places.slice(24, 48)]);
    expect(some.frames).toBe(2);
  });

  it("of one frame stand where they are low", () => {
    expect([...contacts(rig, rows([[height, 0]])).states]).toEqual(Array(4).fill(STANDS));
  });

  it("group joints by feet", () => {
    expect(footGroups(rig)).toEqual([
      [0, 1],
      [2, 3],
    ]);
    expect(footGroups({ ...rig, feet: [rig.feet[3], rig.feet[0]] })).toEqual([[1], [0]]);
  });
});
