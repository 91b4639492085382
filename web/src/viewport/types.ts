/** What the viewport shows and what it tells: plain values, so that it knows nothing of the document or of Svelte. */

import type { Pose, Rig } from "../rig";

export type Phase = "start" | "drag" | "end";
export type Tool = "select" | "rotate" | "reach" | "place" | "draw";

/** A key pose that is shown as a ghost. */
export interface Ghost {
  readonly key: string;
  readonly pose: Pose;
  readonly selected: boolean;
}

/** One candidate of the gap that is looked at: its rows with both keys. */
export interface CandidateView {
  readonly rows: Float32Array;
  readonly frames: number;
  readonly chosen: boolean;
}

/** A way on the ground that may be picked; x, z in metres. */
export interface WayView {
  readonly points: readonly (readonly [number, number])[];
  readonly chosen: boolean;
  readonly label: string;
}

/** A path by its control points: between the two keys' places, which are its fixed ends. */
export interface LineView {
  readonly from: readonly [number, number];
  readonly to: readonly [number, number];
  readonly points: readonly (readonly [number, number])[];
}

/** Everything that is shown. A field that did not change keeps its identity, and is not built anew. */
export interface View {
  readonly rig: Rig | null;
  /** The pose at the playhead. */
  readonly pose: Pose | null;
  readonly ghosts: readonly Ghost[];
  /** The motion around the playhead for trails and contacts: rows, the frame of the first, and the key frames. */
  readonly motion: { readonly rows: Float32Array; readonly first: number; readonly keys: readonly number[] } | null;
  readonly frame: number;
  readonly candidates: readonly CandidateView[];
  /** Frames since the candidates' gap began; all of them are shown at this frame. */
  readonly candidateFrame: number;
  readonly spread: "overlaid" | "side by side";
  readonly ways: readonly WayView[];
  readonly line: LineView | null;
  /** Between which places the tool draw may make a line where there is none yet; else those of the candidates. */
  readonly ends?: Pick<LineView, "from" | "to"> | null;
  /** rotate, reach and place change `pose` by gizmos (only where `editable`); draw draws a line on the ground. */
  readonly tool: Tool;
  readonly editable: boolean;
  /** The joint that is turned by the tool rotate. */
  readonly joint: number | null;
  readonly show: {
    readonly trails: boolean;
    readonly contacts: boolean;
    readonly ghosts: boolean;
    readonly others: boolean;
  };
  readonly theme: "light" | "dark";
  /** The camera follows the figure's root on the ground. */
  readonly follow: boolean;
}

export interface Events {
  /** A ghost was clicked. */
  pickKey(key: string): void;
  /** A candidate's figure or way was clicked. */
  pickCandidate(index: number): void;
  pickWay(index: number): void;
  pickJoint(joint: number | null): void;
  /**
   * `pose` as it is being changed by a gizmo or by inverse kinematics; begins once the pointer has moved. Escape during a
   * drag ends it with the pose that it began with.
   */
  changePose(pose: Pose, phase: Phase): void;
  /** The line's control points as they are dragged, added (double click) or removed (delete), or a new line drawn. */
  changeLine(points: (readonly [number, number])[], phase: Phase): void;
}
