import { describe, expect, it } from "vitest";
import { palettes } from "../../../src/viewport/scene/palette";

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
