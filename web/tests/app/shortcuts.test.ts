import { describe, expect, it } from "vitest";
import { type Pressed, shortcutOf, SHORTCUTS } from "../../src/app/shortcuts";

const press = (key: string, held: Partial<Pressed> = {}) =>
  shortcutOf({ key, ctrlKey: false, metaKey: false, shiftKey: false, altKey: false, ...held })?.does;

describe("the keyboard", () => {
  it("does what the list says", () => {
    expect(press(" ")).toBe("Play or pause");
    expect(press("k")).toBe("Add a key with this pose");
    expect(press("K")).toBe("Add a key with this pose");
    expect(press("Delete")).toBe(press("Backspace"));
    expect(press("ArrowLeft")).toBe("Previous frame");
    expect(press("ArrowLeft", { shiftKey: true })).toBe("Ten frames back");
    expect(press("3")).toBe("Choose candidate 3");
    expect(press("?", { shiftKey: true })).toBe("Show this help");
  });

  it("tells undo from redo, on either system", () => {
    for (const mod of ["ctrlKey", "metaKey"]) {
      expect(press("z", { [mod]: true })).toBe("Undo");
      expect(press("Z", { [mod]: true, shiftKey: true })).toBe("Redo");
      expect(press("y", { [mod]: true })).toBe("Redo");
    }
    expect(press("z")).toBeUndefined();
  });

  it("leaves what the browser has with other modifiers alone", () => {
    expect(press("k", { ctrlKey: true })).toBeUndefined();
    expect(press("l", { altKey: true })).toBeUndefined();
    expect(press("F5")).toBeUndefined();
  });

  it("has nothing twice", () => {
    const all = SHORTCUTS.flatMap(({ keys }) => keys.split(" "));
    expect(new Set(all).size).toBe(all.length);
  });
});
