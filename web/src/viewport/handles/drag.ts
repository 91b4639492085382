/** A drag that changes a value. Escape restores the value. */

import type { Pose } from "../../rig";
import type { Pointer } from "../picking/geometry";
import type { Drag } from "../picking/pointing";
import type { Phase } from "../types";

export type ChangePose = (pose: Pose, phase: Phase) => void;

/** `make` returns the value for a pointer, or null to keep it; `done` is always called at the end. */
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
