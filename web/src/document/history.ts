/** Unlimited undo and redo. A history is a list of documents, which share their unchanged parts. */

import type { Document } from "./document";

interface Step {
  readonly document: Document;
  /** The name of the edit, for the user. */
  readonly label: string;
  /** Consecutive steps with the same value are merged, as during a drag. */
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

/** The history after a change; unchanged if the document is the same. */
export function change(history: History, document: Document, label: string, merge: string | null = null): History {
  const { past, present } = history;
  if (document === present.document) return history;
  const step = { document, label, merge };
  const goesOn = merge !== null && merge === present.merge && past.length > 0;
  return { past: goesOn ? past : [...past, present], present: step, future: [] };
}

/** Ends merging: the next change is a step of its own. */
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
