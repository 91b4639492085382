import { describe, expect, it } from "vitest";
import { clamped, fitted, lowerBound, MARGIN, revealed, scrolled, seconds, shown, steps, ticks, toFrame, toX, zoomed } from "../../src/timeline/layout";

const all = () => false;

describe("the scale", () => {
  it("fits everything between its margins", () => {
    const scale = fitted(0, 340, 1280);
    expect(toX(scale, 0)).toBeCloseTo(MARGIN);
    expect(toX(scale, 340)).toBeLessThanOrEqual(1280 - MARGIN);
    expect(toFrame(scale, toX(scale, 77))).toBeCloseTo(77);
  });

  it("fits a clip of one key without a division by nothing", () => {
    const scale = fitted(0, 0, 1280);
    expect(Number.isFinite(scale.zoom)).toBe(true);
    expect(scale.zoom).toBeGreaterThan(0);
  });

  it("keeps what is under the pointer while zooming", () => {
    const scale = fitted(0, 1000, 1200);
    const before = toFrame(scale, 500);
    expect(toFrame(zoomed(scale, 1.5, 500, 1000, 1200), 500)).toBeCloseTo(before);
  });

  it("has limits", () => {
    const scale = fitted(0, 1000, 1200);
    expect(zoomed(scale, 1e9, 0, 1000, 1200).zoom).toBe(40);
    expect(zoomed(scale, 1e-9, 0, 1000, 1200).zoom).toBeCloseTo(0.6);
    const far = scrolled(scale, 1e9, 1000, 1200);
    expect(toX(far, 1000)).toBeGreaterThan(0);
    expect(scrolled(scale, -1e9, 1000, 1200)).toEqual(clamped({ ...scale, origin: -1e9 }, 1000, 1200));
  });

  it("brings a frame into view only when it is not", () => {
    const scale = { origin: 0, zoom: 10 };
    expect(revealed(scale, 50, 1000, 1000)).toBe(scale);
    const moved = revealed(scale, 500, 1000, 1000);
    expect(toX(moved, 500)).toBeCloseTo(1000 - MARGIN);
  });
});

describe("ticks", () => {
  it("stand at seconds when far, at frames when near", () => {
    expect(ticks({ origin: 0, zoom: 3.4 }, 1280, 30).filter(({ major }) => major).map(({ frame }) => frame).slice(0, 3)).toEqual([0, 30, 60]);
    expect(ticks({ origin: 0, zoom: 40 }, 200, 30).map(({ frame }) => frame)).toEqual([0, 1, 2, 3, 4, 5]);
  });

  it("never crowd, at any zoom and rate", () => {
    for (const rate of [23.976, 24, 25, 30, 60, 120]) {
      for (let zoom = 0.01; zoom < 40; zoom *= 1.3) {
        const made = ticks({ origin: 0, zoom }, 1920, rate);
        expect(made.length).toBeLessThan(1920 / 6);
        const major = made.filter((tick) => tick.major);
        if (major.length > 1) expect((major[1].frame - major[0].frame) * zoom).toBeGreaterThan(60);
      }
    }
  });

  it("steps divide a second", () => {
    expect(steps(24).slice(0, 4)).toEqual([1, 2, 24, 48]);
    expect(steps(1)[0]).toBe(1);
  });
});

describe("what is drawn", () => {
  const many = Array.from({ length: 2000 }, (_, i) => i * 5);

  it("is what is in view", () => {
    const { keys, gaps } = shown(many, { origin: 5000, zoom: 10 }, 1000, all);
    expect(many[keys[0]]).toBeGreaterThanOrEqual(4990);
    expect(keys.length).toBeLessThan(30);
    expect(gaps.length).toBeLessThan(30);
  });

  it("is no more than there are pixels for, but always what is selected", () => {
    const { keys, gaps } = shown(many, fitted(0, 9995, 1280), 1280, (i) => i === 1001);
    expect(keys.length).toBeLessThan(300);
    expect(keys).toContain(1001);
    expect(gaps).toEqual([]);
  });

  it("shows a gap whose keys are both out of view", () => {
    expect(shown([0, 10_000], { origin: 5000, zoom: 10 }, 500, all).gaps).toEqual([0]);
  });

  it("finds by halving", () => {
    expect([0, 4, 5, 9995, 9996].map((frame) => lowerBound(many, frame))).toEqual([0, 1, 1, 1999, 2000]);
  });
});

it("writes seconds without idle zeros", () => {
  expect([seconds(45, 30), seconds(60, 30), seconds(1, 30), seconds(0, 30)]).toEqual(["1.5 s", "2 s", "0.03 s", "0 s"]);
});
