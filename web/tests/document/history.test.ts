import { describe, expect, it } from "vitest";
import { moveKeys, rename } from "../../src/document/commands";
import { begin, change, redo, seal, undo } from "../../src/document/history";
import { keyed } from "../rigs";

describe("a history", () => {
  const first = keyed([0, 30, 60]);

  it("goes back and forth over a thousand changes and loses none", () => {
    let history = begin(first, "Open");
    const seen = [first];
    for (let i = 0; i < 1000; i++) {
      const next = rename(history.present.document, `name ${i}`);
      history = change(history, next, "Rename");
      seen.push(next);
    }
    for (let i = 999; i >= 0; i--) {
      history = undo(history);
      expect(history.present.document).toBe(seen[i]);
    }
    expect(undo(history)).toBe(history);
    for (let i = 1; i <= 1000; i++) {
      history = redo(history);
      expect(history.present.document).toBe(seen[i]);
    }
    expect(redo(history)).toBe(history);
  });

  it("makes one step of a drag, and another one of the next drag", () => {
    let history = begin(first, "Open");
    for (const by of [1, 2, 3]) history = change(history, moveKeys(first, ["k30"], by), "Move", "drag");
    const dropped = history.present.document;
    history = change(seal(history), moveKeys(dropped, ["k30"], 1), "Move", "drag");
    history = undo(history);
    expect(history.present.document).toBe(dropped);
    expect(undo(history).present.document).toBe(first);
  });

  it("forgets what was undone once something else is done", () => {
    let history = change(begin(first, "Open"), rename(first, "a"), "Rename");
    history = change(undo(history), rename(first, "b"), "Rename");
    expect(redo(history)).toBe(history);
    expect(history.present.document.name).toBe("b");
  });

  it("has no step for what changed nothing", () => {
    const history = begin(first, "Open");
    expect(change(history, first, "Nothing")).toBe(history);
  });
});
