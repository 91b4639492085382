/** One change of a value by dragging: told from its start to its end, and taken back by Escape. */

import type { Pose } from "../rig";
import type { Pointer } from "./pick";
import type { Drag } from "./pointing";
import type { Phase } from "./types";

export type ChangePose = (pose: Pose, phase: Phase) => void;

/** `make` gives the value for a pointer, or null to leave it; `done` is called in any case. */
export function changing<T>(
  before: T,
  change: (value: T, phase: Phase) => void,
  make: (at: Pointer) => T | null,
  done: () => void = () => {},
): Drag {
  let now: T | null = null;
  return {
    move(at) {
      const made = make(at);
      if (made === null) return;
      const phase = now === null ? "start" : "drag";
      now = made;
      change(made, phase);
    },
    end() {
      done();
      if (now !== null) change(now, "end");
    },
    cancel() {
      done();
      if (now !== null) change(before, "end");
    },
  };
}
