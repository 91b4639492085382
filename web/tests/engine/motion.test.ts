import { describe, expect, it } from "vitest";
import type { Gap, Key } from "../../src/document/document";
import { addKey, fromClip } from "../../src/document/commands";
import { poseAt, poseBetween, rowsBetween, sourceAt, wholeMotion } from "../../src/engine/motion";
import { alike, between, mix, stretched } from "../../src/engine/poses";
import { keyed, pose, rig, STRIDE } from "../rigs";

const RIG = rig(100);
const shown = (rows: (gap: Gap) => Float32Array) => ({ rows, pose: (key: Key) => key.pose });
const JOINTS = RIG.joints.length;

describe("a document's motion", () => {
  const document = keyed([10, 14, 20]);
  const rowsOf = (gap: Gap) =>
    Float32Array.from({ length: gap.frames * STRIDE }, (_, i) => gap.left.frame + 1 + Math.floor(i / STRIDE));

  it("is its keys and its gaps' rows, and stands still outside", () => {
    expect(poseAt(document, shown(rowsOf), 12)[0]).toBe(12);
    expect(poseAt(document, shown(rowsOf), 14)).toBe(document.keys[1].pose);
    expect(poseAt(document, shown(rowsOf), 3)).toBe(document.keys[0].pose);
    expect(poseAt(document, shown(rowsOf), 99)).toBe(document.keys[2].pose);
  });

  it("is the same by stretches as by poses", () => {
    for (const [first, last] of [[10, 20], [11, 13], [14, 14], [13, 16]]) {
      const rows = rowsBetween(document, shown(rowsOf), first, last);
      expect(rows).toHaveLength((last - first + 1) * STRIDE);
      for (let frame = first; frame <= last; frame++) {
        expect(rows.subarray((frame - first) * STRIDE, (frame - first + 1) * STRIDE)).toEqual(poseAt(document, shown(rowsOf), frame));
      }
    }
  });

  it("between frames is between their poses", () => {
    const clip = fromClip({ name: "a", text: "" }, RIG);
    const rows = () => RIG.frames.subarray(STRIDE, 99 * STRIDE);
    expect(poseBetween(clip, shown(rows), 10.5, JOINTS)[0]).toBeCloseTo(0.105, 6);
  });

  it("tells which frames are the file's own", () => {
    const clip = addKey(addKey(fromClip({ name: "a", text: "" }, RIG), 60, pose(0.6), 60), 30, pose(9), null);
    expect([0, 1, 30, 31, 60, 61, 99].map((frame) => sourceAt(clip, frame))).toEqual([0, null, null, null, 60, 61, 99]);
    const { own, rows } = wholeMotion(clip, shown((gap) => new Float32Array(gap.frames * STRIDE)));
    expect(own.slice(0, 3)).toEqual([[0, 0], [60, 60], [61, 61]]);
    expect(own).toHaveLength(41);
    expect(rows).toHaveLength(100 * STRIDE);
  });
});

describe("poses between poses", () => {
  const turned = pose(1);
  turned.set([0, Math.sin(0.5), 0, Math.cos(0.5)], 3);

  it("turn along the nearer way and stay of unit length", () => {
    const other = turned.map((value, i) => (i >= 3 && i < 7 ? -value : value));
    for (const target of [turned, other]) {
      const half = mix(pose(0), target, 0.5, JOINTS);
      expect(half[0]).toBeCloseTo(0.5, 6);
      expect(Math.abs(half[4])).toBeCloseTo(Math.sin(0.25), 5);
      expect(Math.hypot(...half.subarray(3, 7))).toBeCloseTo(1, 6);
    }
  });

  it("in even steps leave out both ends", () => {
    expect([0, 1, 2].map((i) => between(pose(0), pose(1), 3, JOINTS)[i * STRIDE])).toEqual([0.25, 0.5, 0.75]);
  });

  it("stretched keep their ends", () => {
    const rows = between(pose(0), pose(1), 9, JOINTS);
    const made = stretched(rows, STRIDE, 17, JOINTS);
    expect(made[0]).toBe(rows[0]);
    expect(made[16 * STRIDE]).toBeCloseTo(rows[8 * STRIDE], 6);
    expect(stretched(rows, STRIDE, 9, JOINTS)).toBe(rows);
    expect(stretched(rows, STRIDE, 1, JOINTS)[0]).toBeCloseTo(0.5, 6);
  });

  it("are alike within a centimetre", () => {
    expect(alike(pose(0), pose(0.009))).toBe(true);
    expect(alike(pose(0), pose(0.011))).toBe(false);
    expect(alike(pose(0), new Float32Array(0))).toBe(false);
  });
});
