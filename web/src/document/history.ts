/** Undo and redo without a limit: documents share what they have in common, so a history is a list of them. */

import type { Document } from "./document";

interface Step {
  readonly document: Document;
  /** What was done to come here, for people. */
  readonly label: string;
  /** Steps that follow one another with the same word are one, as while something is dragged. */
  readonly merge: string | null;
}

export interface History {
  readonly past: readonly Step[];
  readonly present: Step;
  readonly future: readonly Step[];
}

export function begin(document: Document, label: string): History {
  return { past: [], present: { document, label, merge: null }, future: [] };
}

/** The history after a change; the same one where nothing changed. */
export function change(history: History, document: Document, label: string, merge: string | null = null): History {
  const { past, present } = history;
  if (document === present.document) return history;
  const step = { document, label, merge };
  const goesOn = merge !== null && merge === present.merge && past.length > 0;
  return { past: goesOn ? past : [...past, present], present: step, future: [] };
}

/** The last change is closed: a further one is a step of its own, whatever its word. */
export function seal(history: History): History {
  return history.present.merge === null ? history : { ...history, present: { ...history.present, merge: null } };
}

export function undo(history: History): History {
  const step = history.past.at(-1);
  if (!step) return history;
  return { past: history.past.slice(0, -1), present: step, future: [history.present, ...history.future] };
}

export function redo(history: History): History {
  const [step, ...future] = history.future;
  if (!step) return history;
  return { past: [...history.past, history.present], present: step, future };
}
