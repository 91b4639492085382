/** One change of a pose by dragging: told from its start to its end, and taken back by Escape. */

import type { Pose } from "../rig";
import type { Pointer } from "./pick";
import type { Drag } from "./pointing";
import type { Phase } from "./types";

export type ChangePose = (pose: Pose, phase: Phase) => void;

/** `make` gives the pose for a pointer, or null to leave it; `done` is called in any case. */
export function poseDrag(
  before: Pose,
  change: ChangePose,
  make: (at: Pointer) => Pose | null,
  done: () => void = () => {},
): Drag {
  let now: Pose | null = null;
  return {
    move(at) {
      const made = make(at);
      if (!made) return;
      const phase = now ? "drag" : "start";
      now = made;
      change(made, phase);
    },
    end() {
      done();
      if (now) change(now, "end");
    },
    cancel() {
      done();
      if (now) change(before.slice(), "end");
    },
  };
}
