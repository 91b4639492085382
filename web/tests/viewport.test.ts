import { Quaternion, Ray, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { forward, placeOf } from "../src/pose/kinematics";
import { moveOnGround, turnAboutHips } from "../src/pose/place";
import type { Rig } from "../src/rig";
import { hueOf, shiftOf } from "../src/viewport/characters/candidates";
import { decalGeometry } from "../src/viewport/marks/decals";
import { dotGeometry } from "../src/viewport/marks/dots";
import { controlPoints } from "../src/viewport/paths/drawn-path";
import { palettes } from "../src/viewport/scene/palette";
import { hitBones, onLevel, onPlane, pixelsToPolyline } from "../src/viewport/picking/geometry";
import type { Pointer } from "../src/viewport/picking/geometry";
import { changing } from "../src/viewport/handles/drag";
import { ribbonGeometry } from "../src/viewport/marks/ribbons";
import { mixed, silhouettes } from "../src/viewport/characters/thumbnails";
import { drawnFrames, trailed } from "../src/viewport/characters/trails";
import { alongTurn, circle, roundTurn, turnedBy, wrapped } from "../src/viewport/handles/turning";
import { humanoid, rest } from "./pose/rigs";

const rig = humanoid() as unknown as Rig;

/** A walk of the rest pose along a way. */
function walk(frames: number, x: number, z: number): Float32Array {
  const rows = new Float32Array(frames * rig.stride);
  for (let i = 0; i < frames; i++)
    rows.set(rest(rig, (x * i) / (frames - 1), 0.97, (z * i) / (frames - 1)), i * rig.stride);
  return rows;
}

describe("picking", () => {
  it("measures pixels to a line of spots, and passes over what is not seen", () => {
    const spots = [
      { x: 0, y: 0, visible: true },
      { x: 10, y: 0, visible: true },
      { x: 10, y: 10, visible: false },
    ];
    expect(pixelsToPolyline(spots, 5, 3)).toBe(3);
    expect(pixelsToPolyline(spots, 13, 4)).toBe(5);
    expect(pixelsToPolyline(spots.slice(1), 10, 5)).toBe(Infinity);
  });

  it("hits the nearest bone of a body", () => {
    const globals = forward(rig, rest(rig));
    const knee = new Vector3(...placeOf(globals, 2));
    const ray = new Ray(new Vector3(knee.x, knee.y + 0.2, 5), new Vector3(0, 0, -1));
    const hit = hitBones(rig, globals, new Vector3(), ray, 0.08);
    expect(hit?.joint).toBe(1);
    expect(hit?.distance).toBeCloseTo(5, 1);
    expect(hitBones(rig, globals, new Vector3(3, 0, 0), ray, 0.08)).toBeNull();
  });

  it("does not hit what lies above the hips", () => {
    const above = { parents: [-1, 0, 1], humanoid: { Hips: 1 } };
    const globals = { positions: new Float64Array([0, 0, 0, 0, 1, -4, 0, 2, -4]), rotations: new Float64Array(12) };
    const ray = new Ray(new Vector3(5, 0.5, -2), new Vector3(-1, 0, 0));
    expect(hitBones(above, globals, new Vector3(), ray, 0.1)).toBeNull();
    expect(
      hitBones(above, globals, new Vector3(), new Ray(new Vector3(5, 1.5, -4), new Vector3(-1, 0, 0)), 0.1)?.joint,
    ).toBe(1);
  });

  it("meets the ground and planes", () => {
    const ray = new Ray(new Vector3(0, 2, 0), new Vector3(0, -1, 1).normalize());
    expect(
      onLevel(ray, 0)
        ?.toArray()
        .map((v) => Math.round(v * 1e6) / 1e6),
    ).toEqual([0, 0, 2]);
    expect(onLevel(ray, 3)).toBeNull();
    expect(onLevel(ray, 0, 1)).toBeNull();
    expect(onPlane(ray, new Vector3(0, 0, -1), new Vector3(0, 0, 1))?.y).toBeCloseTo(1, 6);
  });
});

describe("turning by rings", () => {
  it("makes circles across an axis", () => {
    const axis = new Vector3(1, 2, -1).normalize();
    for (const point of circle(new Vector3(1, 1, 1), axis, 2, 12)) {
      const arm = point.sub(new Vector3(1, 1, 1));
      expect(arm.length()).toBeCloseTo(2, 9);
      expect(arm.dot(axis)).toBeCloseTo(0, 9);
    }
  });

  it("goes round a ring on the screen, against the clock where its axis looks at the eye", () => {
    const middle = { x: 100, y: 100, visible: true };
    const [right, top] = [
      { x: 150, y: 100, visible: true },
      { x: 100, y: 50, visible: true },
    ];
    expect(roundTurn(middle, right, top, true)).toBeCloseTo(Math.PI / 2, 9);
    expect(roundTurn(middle, right, top, false)).toBeCloseTo(-Math.PI / 2, 9);
  });

  it("goes along a ring that is seen from its edge", () => {
    const [from, to] = [
      { x: 0, y: 0, visible: true },
      { x: 30, y: 40, visible: true },
    ];
    expect(alongTurn({ x: 0, y: 2 }, from, to, 80)).toBeCloseTo(0.5, 9);
  });

  it("wraps angles and turns in the world", () => {
    expect(wrapped(1.5 * Math.PI)).toBeCloseTo(-0.5 * Math.PI, 9);
    const turned = turnedBy(new Quaternion(), new Vector3(0, 1, 0), Math.PI / 2);
    expect(new Vector3(0, 0, 1).applyQuaternion(turned).x).toBeCloseTo(1, 9);
  });
});

describe("a dragged pose", () => {
  const at = (x: number): Pointer => ({ x, y: 0, ray: new Ray(), shift: false, slack: 0 });
  const drag = (told: [number, string][]) =>
    changing(
      new Float32Array([7]),
      (pose, phase) => told.push([pose[0], phase]),
      ({ x }) => (x < 0 ? null : new Float32Array([x])),
    );

  it("is told from its start to its end", () => {
    const told: [number, string][] = [];
    const held = drag(told);
    held.move(at(-1));
    held.move(at(1));
    held.move(at(2));
    held.end();
    expect(told).toEqual([
      [1, "start"],
      [2, "drag"],
      [2, "end"],
    ]);
  });

  it("is taken back, and is not told of where nothing moved", () => {
    const told: [number, string][] = [];
    const held = drag(told);
    held.cancel();
    held.end();
    expect(told).toEqual([]);
    held.move(at(3));
    held.cancel();
    expect(told).toEqual([
      [3, "start"],
      [7, "end"],
    ]);
  });
});

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

describe("strokes", () => {
  const ends = { from: [0, 0], to: [4, 0] } as const;

  it("become few control points that stay clear of the ends", () => {
    const stroke = Array.from({ length: 120 }, (_, i): [number, number] => [i / 30, Math.sin((i / 119) * Math.PI)]);
    const points = controlPoints(stroke, ends, 1);
    expect(points.length).toBeGreaterThan(1);
    expect(points.length).toBeLessThan(10);
    for (const [x, z] of points) expect(Math.min(Math.hypot(x, z), Math.hypot(x - 4, z))).toBeGreaterThan(0.19);
  });

  it("that are straight keep one point, so that they are a line and not none", () => {
    const stroke = Array.from({ length: 40 }, (_, i): [number, number] => [i / 10, 0]);
    expect(controlPoints(stroke, ends, 1)).toEqual([[2, 0]]);
    expect(controlPoints([[0, 0]], ends, 1)).toEqual([]);
  });
});

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

describe("palettes", () => {
  const luminance = (colour: string): number => {
    const parts = [1, 3, 5].map((i) => Number.parseInt(colour.slice(i, i + 2), 16) / 255);
    const [r, g, b] = parts.map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (a: string, b: string): number => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };

  it.each(["light", "dark"] as const)("can be read (%s)", (theme) => {
    const palette = palettes[theme];
    expect(contrast(palette.ink, palette.paper)).toBeGreaterThan(7);
    expect(contrast(palette.faint, palette.paper)).toBeGreaterThan(4.5);
    for (const colour of [palette.accent, palette.target, ...palette.hues])
      expect(contrast(colour, palette.ground)).toBeGreaterThan(2.7);
    for (const colour of [palette.accent, palette.warning]) expect(contrast(colour, palette.ground)).toBeGreaterThan(3);
  });
});
