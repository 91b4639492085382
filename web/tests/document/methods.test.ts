import { describe, expect, it } from "vitest";
import { DEFAULT_SETTINGS } from "../../src/document/document";
import { infoOf, withMethod, withStyle } from "../../src/document/methods";
import { methodOptions } from "../../src/panels/gap/gap";
import { gapsOf } from "../../src/document/document";
import type { MethodInfo } from "../../src/protocol";
import { keyed, rig } from "../rigs";

const info = (method: string, model: string | null, styles: string[]): MethodInfo => ({
  method, model, styles, summary: `${method} does it`, licence: null, paths: model !== null, gallery: true, partial_targets: false,
  variants: model !== null, longest_seconds: model === null ? null : 20, any_rig: model === null,
});
const METHODS = [info("dcmoe", "default", ["Angry", "Drunk"]), info("dcmoe", "other", ["Angry"]), info("toy", "default", []), info("interp", null, [])];
const SETTINGS = {
  ...DEFAULT_SETTINGS, style: "Angry", blend: { style: "Drunk", share: 0.5 }, style_strength: 2, path: { kind: "straight" as const },
  path_control: 0.5, target_joints: "hands",
};

describe("methods", () => {
  it("come with the model that is named, or with the first one", () => {
    expect(infoOf({ method: "dcmoe", model: null }, METHODS)?.model).toBe("default");
    expect(infoOf({ method: "dcmoe", model: "other" }, METHODS)?.styles).toEqual(["Angry"]);
    expect(infoOf({ method: "dcmoe", model: "gone" }, METHODS)).toBe(null);
    expect(infoOf({ method: "clip", model: null }, METHODS)).toBe(null);
  });

  it("reset what they do not support", () => {
    expect(withMethod(SETTINGS, { method: "dcmoe", model: "other" }, METHODS)).toEqual({
      method: "dcmoe", model: "other", style: "Angry", blend: null, style_strength: 2, path: { kind: "straight" }, path_control: 0.5,
      target_joints: "hands",
    });
    expect(withMethod(SETTINGS, { method: "interp", model: null }, METHODS)).toEqual({
      method: "interp", model: null, style: null, blend: null, style_strength: 1, path: { kind: "auto" }, path_control: 1,
      target_joints: null,
    });
    expect(withMethod(SETTINGS, { method: "clip", model: null }, METHODS)).toEqual({ method: "clip", model: null });
  });

  it("of the registry are all offered, with the reason where one cannot serve", () => {
    const [gap] = gapsOf(keyed([0, 20]));
    const options = methodOptions(gap, { ...rig(30), reason: null }, METHODS);
    expect(options.map(({ value, label, disabled }) => [value, label, disabled])).toEqual([
      ["dcmoe", "DC-MoE", false], ["toy", "toy", false], ["interp", "Interpolate", false],
    ]);
    const rigid = methodOptions(gap, { ...rig(30), reason: "it has no legs" }, METHODS);
    expect(rigid.map(({ value, tip, disabled }) => [value, tip, disabled])).toEqual([
      ["dcmoe", "needs a humanoid rig", false], ["toy", "needs a humanoid rig", true], ["interp", "interp does it", false],
    ]);
    const [long] = gapsOf(keyed([0, 900]));
    expect(methodOptions(long, { ...rig(30), reason: null }, METHODS)[1].tip).toBe("for gaps of up to 20 s");
  });

  it("blend two different styles, and have no strength without one", () => {
    expect(withStyle(SETTINGS, "Drunk")).toEqual({ style: "Drunk", blend: null, style_strength: 2 });
    expect(withStyle(SETTINGS, null)).toEqual({ style: null, blend: null, style_strength: 1 });
  });
});
