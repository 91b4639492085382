/** Keyboard control of a focused key or gap. Other keys are left to the application's shortcuts. */

import type { Gap } from "../../document/document";
import { keyOf } from "../../document/document";
import type { Studio } from "../../studio.svelte";
import type { Item } from "../view.svelte";

export function trackKey(event: KeyboardEvent, studio: Studio, gaps: readonly Gap[], focus: (item: Item) => void): void {
  const target = event.target as HTMLElement;
  const key = target.dataset.key;
  const gap = target.dataset.gap;
  const id = key ?? gap;
  if (!id || event.ctrlKey || event.metaKey || event.altKey) return;
  const direction = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -1, ArrowDown: 1 }[event.key];
  const sideways = event.key === "ArrowLeft" || event.key === "ArrowRight";
  if (direction !== undefined && key && sideways) nudge(studio, key, direction * (event.shiftKey ? 10 : 1));
  else if (direction !== undefined) {
    const next = neighbour(studio, gaps, { kind: key ? "key" : "gap", id }, direction);
    if (next) focus(next);
  } else if (event.key === "Enter" && key) studio.selectKey(key, event.shiftKey ? "range" : "only");
  else if ((event.key === "Enter" || event.key === " ") && gap) studio.selectGap(gap);
  else if (event.key === " " && key) studio.selectKey(key, "toggle");
  else if ((event.key === "Delete" || event.key === "Backspace") && key) remove(studio, key, focus);
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function nudge(studio: Studio, id: string, by: number): void {
  const key = studio.document && keyOf(studio.document, id);
  if (!key) return;
  const here = studio.playback.frame === key.frame;
  const ids = studio.selection.keys.includes(id) ? studio.selection.keys : [id];
  studio.moveKeys(ids, by, `nudge:${id}`);
  const now = studio.document && keyOf(studio.document, id);
  if (here && now) studio.playback.goTo(now.frame);
}

function remove(studio: Studio, id: string, focus: (item: Item) => void): void {
  const keys = studio.document?.keys ?? [];
  const index = keys.findIndex((key) => key.id === id);
  if (!studio.selection.keys.includes(id)) studio.selection = { keys: [id], gap: null };
  studio.deleteSelected();
  const left = studio.document?.keys ?? [];
  const next = left[Math.min(index, left.length - 1)];
  if (next) focus({ kind: "key", id: next.id });
}

/** Keys and gaps in turn: key, its gap, the next key, … */
function neighbour(studio: Studio, gaps: readonly Gap[], item: Item, direction: number): Item | null {
  const keys = studio.document?.keys ?? [];
  const index = keys.findIndex((key) => key.id === item.id);
  const place = 2 * index + (item.kind === "gap" ? 1 : 0) + direction;
  const key = keys[place >> 1];
  if (place < 0 || !key) return null;
  if (place % 2 === 0) return { kind: "key", id: key.id };
  return gaps[place >> 1] ? { kind: "gap", id: key.id } : null;
}
