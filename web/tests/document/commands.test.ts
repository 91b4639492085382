import { describe, expect, it } from "vitest";
import * as commands from "../../src/document/commands";
import { gapOf, keyAtFrame } from "../../src/document/document";
import { keyed, pose, rig, STRIDE } from "../rigs";

const framesOf = (document: { keys: readonly { frame: number }[] }) => document.keys.map((key) => key.frame);

describe("a clip that was opened", () => {
  const clip = commands.fromClip({ name: "walk.BVH", text: "" }, rig(100));

  it("has its ends as keys and is left as it was between them", () => {
    expect(framesOf(clip)).toEqual([0, 99]);
    expect(clip.keys.map((key) => key.source)).toEqual([0, 99]);
    expect(clip.keys[0].after.method).toBe("clip");
    expect(clip.name).toBe("walk");
  });

  it("stays as it was on both sides of a key of its own", () => {
    const cut = commands.addKey(clip, 40, pose(0.4), 40);
    expect(cut.keys.slice(0, 2).map((key) => key.after.method)).toEqual(["clip", "clip"]);
  });

  it("is generated where a key was moved or edited", () => {
    const cut = commands.addKey(clip, 40, pose(0.4), 40);
    const id = cut.keys[1].id;
    for (const changed of [commands.moveKeys(cut, [id], 5), commands.setPose(cut, id, pose(9))]) {
      expect(changed.keys.slice(0, 2).map((key) => key.after.method)).toEqual(["dcmoe", "dcmoe"]);
    }
  });

  it("of one frame has one key", () => {
    expect(framesOf(commands.fromClip({ name: "pose.bvh", text: "" }, rig(1)))).toEqual([0]);
  });
});

describe("keys", () => {
  it("are added in order, with what was request of the gap that they divide", () => {
    const made = commands.addKey(keyed([0, 90], { style: "Angry" }), 30, pose(5), null);
    expect(framesOf(made)).toEqual([0, 30, 90]);
    expect(made.keys[1].after.style).toBe("Angry");
    expect(made.keys[1].pose[0]).toBe(5);
  });

  it("at a frame that has one get the pose and stay the same key", () => {
    const made = commands.addKey(keyed([0, 90]), 90, pose(5), null);
    expect(made.keys.map((key) => key.id)).toEqual(["k0", "k90"]);
    expect(made.keys[1].pose[0]).toBe(5);
  });

  it("take a copy of the pose that they are given", () => {
    const given = pose(1);
    const made = commands.addKey(keyed([0, 90]), 30, given, null);
    given[0] = 7;
    expect(made.keys[1].pose[0]).toBe(1);
  });

  it("divide a locked gap into its two parts", () => {
    const rows = new Float32Array(9 * STRIDE).map((_, i) => Math.floor(i / STRIDE));
    const locked = commands.lockGap(keyed([0, 10]), "k0", rows);
    const made = commands.addKey(locked, 4, pose(3), null);
    expect(made.keys[0].kept).toEqual(rows.slice(0, 3 * STRIDE));
    expect(made.keys[1].kept).toEqual(rows.slice(4 * STRIDE));
    expect(made.keys.slice(0, 2).map((key) => key.after.locked)).toEqual([true, true]);
  });

  it("move as far as their neighbours allow", () => {
    expect(framesOf(commands.moveKeys(keyed([0, 30, 60]), ["k30"], 100))).toEqual([0, 59, 60]);
    expect(framesOf(commands.moveKeys(keyed([0, 30, 60]), ["k30"], -100))).toEqual([0, 1, 60]);
    expect(framesOf(commands.moveKeys(keyed([5, 30, 60]), ["k5"], -100))).toEqual([0, 30, 60]);
    expect(framesOf(commands.moveKeys(keyed([0, 30, 60]), ["k30", "k60"], 7))).toEqual([0, 37, 67]);
    expect(framesOf(commands.moveKeys(keyed([0, 30, 60, 90]), ["k0", "k60"], -10))).toEqual([0, 30, 60, 90]);
  });

  it("leave the document alone where nothing moves", () => {
    const document = keyed([0, 1, 2]);
    expect(commands.moveKeys(document, ["k1"], 5)).toBe(document);
  });

  it("that move free the locked gaps whose length changes, and no others", () => {
    let document = keyed([0, 30, 60, 90]);
    for (const id of ["k0", "k30", "k60"]) document = commands.lockGap(document, id, new Float32Array(29 * STRIDE));
    const moved = commands.moveKeys(document, ["k30"], 3);
    expect(moved.keys.map((key) => key.after.locked)).toEqual([false, false, true, false]);
    expect(moved.keys.map((key) => key.kept !== null)).toEqual([false, false, true, false]);
  });

  it("are deleted, and the gap before reaches on; one key stays", () => {
    const document = commands.lockGap(keyed([0, 30, 60]), "k0", new Float32Array(29 * STRIDE));
    const made = commands.deleteKeys(document, ["k30"]);
    expect(framesOf(made)).toEqual([0, 60]);
    expect(made.keys[0].after.locked).toBe(false);
    expect(commands.deleteKeys(document, ["k0", "k30", "k60"])).toBe(document);
  });

  it("are copied and pasted with their distances and what is request between them", () => {
    const document = keyed([10, 30, 60], { style: "Drunk" });
    const copied = commands.copyKeys(document, ["k10", "k30"]);
    const made = commands.pasteKeys(document, copied, 100);
    expect(framesOf(made)).toEqual([10, 30, 60, 100, 120]);
    expect(keyAtFrame(made, 120)?.pose).toEqual(document.keys[1].pose);
    expect(keyAtFrame(made, 100)?.after.style).toBe("Drunk");
    expect(commands.pasteKeys({ ...document, stride: 3 }, copied, 100).keys).toHaveLength(3);
  });
});

describe("gaps", () => {
  it("given a length move all later keys along", () => {
    const made = commands.setFrames(keyed([0, 30, 60]), "k0", 39, "slow");
    expect(framesOf(made)).toEqual([0, 40, 70]);
    expect(made.keys[0].after.speed).toBe("slow");
    expect(framesOf(commands.setFrames(made, "k40", 4))).toEqual([0, 40, 70]);
    expect(framesOf(commands.setFrames(made, "k30", 4))).toEqual([0, 40, 45]);
  });

  it("lose their speed when a key is dragged", () => {
    const made = commands.setFrames(keyed([0, 30, 60]), "k0", 39, "slow");
    expect(commands.moveKeys(made, ["k30"], 1).keys[0].after.speed).toBeNull();
    expect(commands.moveKeys(made, ["k60"], 1).keys[0].after.speed).toBe("slow");
  });

  it("that change their length keep the pace of a path from the gallery", () => {
    const points: [number, number][] = [[0, 0], [1, 0], [2, 0]];
    const line = { kind: "waypoints" as const, points, times: [0, 0.5, 1], facing: null, drawn: false };
    const document = commands.setGap(keyed([0, 30, 60]), "k0", { path: line });
    for (const made of [commands.moveKeys(document, ["k30"], 15), commands.setFrames(document, "k0", 44)]) {
      expect(made.keys[0].after.path).toEqual({ ...line, times: [0, 0.75, 1.5] });
    }
    expect(commands.moveKeys(document, ["k60"], 15).keys[0].after.path).toBe(line);
  });

  it("show the best candidate again after any change but of which one shows", () => {
    const chosen = commands.setGap(keyed([0, 30]), "k0", { chosen: 3 });
    expect(chosen.keys[0].after.chosen).toBe(3);
    expect(commands.setGap(chosen, "k0", { style: "Angry" }).keys[0].after.chosen).toBe(0);
    expect(commands.lockGap(chosen, "k0", new Float32Array(29 * STRIDE)).keys[0].after.chosen).toBe(3);
  });

  it("end at the last key", () => {
    const document = keyed([0, 30]);
    expect(gapOf(document, "k0")?.frames).toBe(29);
    expect(gapOf(document, "k30")).toBeNull();
    expect(commands.setFrames(document, "k30", 5)).toBe(document);
  });
});
