import "fake-indexeddb/auto";
import { describe, expect, it } from "vitest";
import * as autosave from "../../src/document/autosave";
import { addKey, fromClip, lockGap, setGap } from "../../src/document/commands";
import { decode, encode, fromProject, toProject } from "../../src/document/project";
import { pose, rig, STRIDE } from "../rigs";

const RIG = rig(100);
const CLIP = fromClip({ name: "walk.bvh", text: "HIERARCHY" }, RIG);

describe("a project file", () => {
  const edited = addKey(addKey(CLIP, 40, pose(1.25, 0.1), null), 70, pose(0.7), 70);
  const locked = lockGap(setGap(edited, edited.keys[0].id, { style: "Angry" }), edited.keys[0].id, rows(39, 0.5));

  it("gives the document again after a way through JSON, to the last bit", () => {
    const { document } = fromProject(JSON.parse(JSON.stringify(toProject(locked, () => null))), RIG);
    expect(document).toEqual(locked);
  });

  it("holds what gaps show, but for what the clip has anyway", () => {
    const shown = rows(29, 0.25);
    const project = toProject(locked, (key) => (key.frame === 40 ? shown : null));
    expect(project.keys.map((key) => key.motion !== null)).toEqual([true, true, false, false]);
    expect(project.keys.map((key) => key.pose !== null)).toEqual([false, true, false, false]);
    const read = fromProject(project, RIG);
    expect([...read.shown]).toEqual([[locked.keys[1].id, shown]]);
  });

  it("keeps floats exactly", () => {
    const values = new Float32Array(70_000).map((_, i) => Math.sin(i) * 10 ** ((i % 60) - 30));
    expect(decode(encode(values))).toEqual(values);
    expect(() => decode(btoa("abc"))).toThrow("3 bytes");
  });
});

describe("the browser's own copy", () => {
  it("is found again by its tab, and offered to other tabs, newest first", async () => {
    const project = (name: string) => ({ ...toProject(CLIP, () => null), name });
    await autosave.save("one", project("first"), true);
    await autosave.save("two", project("second"), false);
    await autosave.save("one", project("first again"), true);
    expect((await autosave.load("one"))?.project.name).toBe("first again");
    expect((await autosave.load("two"))?.changed).toBe(false);
    expect(await autosave.load("three")).toBeNull();
    expect((await autosave.others("three")).map((saved) => saved.tab).sort()).toEqual(["one", "two"]);
    expect((await autosave.others("one")).map((saved) => saved.tab)).toEqual(["two"]);
    await autosave.forget("two");
    expect(await autosave.others("one")).toEqual([]);
  });

  it("is bounded: eight of other tabs are kept", async () => {
    for (let i = 0; i < 12; i++) await autosave.save(`tab ${i}`, toProject(CLIP, () => null), true);
    await autosave.others("mine");
    expect(await autosave.others("mine")).toHaveLength(8);
  });
});

function rows(count: number, value: number): Float32Array {
  return new Float32Array(count * STRIDE).fill(value);
}
