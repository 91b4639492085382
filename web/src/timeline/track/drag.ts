/** Drags keys in time, always from the document at the start of the drag, so that dragging back undoes everything. */

import * as commands from "../../document/commands";
import type { Document } from "../../document/document";

/** `ids` moved by frames; with `ripple`, all keys after the first of them move along. */
export function dragged(start: Document, ids: readonly string[], by: number, ripple: boolean): Document {
  if (by === 0) return start;
  if (!ripple) return commands.moveKeys(start, ids, by);
  const first = start.keys.findIndex((key) => ids.includes(key.id));
  if (first < 0) return start;
  if (first === 0) return commands.moveKeys(start, start.keys.map((key) => key.id), by);
  const before = start.keys[first - 1];
  return commands.setFrames(start, before.id, Math.max(0, start.keys[first].frame - before.frame - 1 + by));
}

/** The keys with frames in a range. */
export function keysBetween(document: Document, a: number, b: number): string[] {
  const from = Math.min(a, b);
  const to = Math.max(a, b);
  return document.keys.filter((key) => key.frame >= from && key.frame <= to).map((key) => key.id);
}
