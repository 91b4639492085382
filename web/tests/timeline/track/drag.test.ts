import { describe, expect, it } from "vitest";
import type { Document, Key } from "../../../src/document/document";
import { AS_IN_CLIP, DEFAULT_SETTINGS } from "../../../src/document/document";
import { dragged, keysBetween } from "../../../src/timeline/track/drag";
import { Snapper } from "../../../src/timeline/track/snap";
import { barText, gapLabel, keyLabel, styleText } from "../../../src/timeline/text";
import { gapsOf } from "../../../src/document/document";

function document(...frames: number[]): Document {
  const keys = frames.map((frame): Key => ({
    id: `k${frame}`,
    frame,
    pose: new Float32Array(7),
    source: frame,
    after: AS_IN_CLIP,
    kept: null,
  }));
  return { name: "walk", source: { name: "walk.bvh", text: "" }, rate: 30, stride: 7, keys };
}

const framesOf = (made: Document) => made.keys.map(({ frame }) => frame);

describe("dragging keys", () => {
  const start = document(0, 45, 90, 150);

  it("goes from where it began, and back to it", () => {
    expect(framesOf(dragged(start, ["k45"], 10, false))).toEqual([0, 55, 90, 150]);
    expect(dragged(start, ["k45"], 10, false).keys[0].after.method).toBe("dcmoe");
    expect(dragged(start, ["k45"], 0, false)).toBe(start);
  });

  it("stops at the neighbours", () => {
    expect(framesOf(dragged(start, ["k45"], 999, false))).toEqual([0, 89, 90, 150]);
    expect(framesOf(dragged(start, ["k45"], -999, false))).toEqual([0, 1, 90, 150]);
  });

  it("takes later keys along", () => {
    expect(framesOf(dragged(start, ["k45"], 10, true))).toEqual([0, 55, 100, 160]);
    expect(framesOf(dragged(start, ["k45"], -999, true))).toEqual([0, 1, 46, 106]);
    expect(framesOf(dragged(start, ["k0"], 5, true))).toEqual([5, 50, 95, 155]);
  });

  it("selects what a rectangle holds, whichever way it was drawn", () => {
    expect(keysBetween(start, 100, 40)).toEqual(["k45", "k90"]);
  });
});

describe("snapping", () => {
  const start = document(0, 40, 90, 150);
  const snapper = new Snapper(start, ["k90"], "k90", 101, false);

  it("draws to the playhead, to other lengths and to seconds", () => {
    expect(snapper.near(102, 4)).toMatchObject({ frame: 101, why: "playhead" });
    expect(snapper.near(79, 4)).toMatchObject({ frame: 80 }); // as long as the gap from 0 to 40
    expect(snapper.near(61, 4)).toMatchObject({ frame: 60, why: "2 s" });
    expect(snapper.near(67, 4)).toBeNull();
  });

  it("lets seconds go where they are but a few pixels", () => {
    expect(snapper.near(61, 0.5)?.why).not.toBe("2 s");
  });
});

describe("words", () => {
  it("name styles, blends and methods", () => {
    expect(styleText({ ...DEFAULT_SETTINGS, style: "Angry", blend: { style: "Chicken", share: 0.4 } })).toBe("Angry 60 / Chicken 40");
    expect(barText({ ...DEFAULT_SETTINGS, style: "Angry" })).toEqual({ style: "Angry", method: "DC-MoE" });
    expect(barText(AS_IN_CLIP)).toEqual({ style: "Clip", method: null });
  });

  it("say what a screen reader needs", () => {
    const [gap] = gapsOf(document(0, 45));
    const angry = { ...gap, settings: { ...DEFAULT_SETTINGS, style: "Angry" } };
    expect(gapLabel(angry, "ready", null)).toBe("Gap from 0 to 45, Angry, dcmoe, ready");
    expect(gapLabel(angry, "failed", "too far")).toBe("Gap from 0 to 45, Angry, dcmoe, failed: too far");
    expect(keyLabel({ ...gap.right, source: null }, 30)).toBe("Key at frame 45, 1.5 s");
  });
});
