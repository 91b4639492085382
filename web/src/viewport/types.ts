/** What the viewport shows, and its events: plain values, independent of the document and of Svelte. */

import type { Pose, Rig } from "../rig";

export type Phase = "start" | "drag" | "end";
export type Tool = "select" | "rotate" | "reach" | "place" | "draw";

/** A key pose that is shown as a ghost. */
export interface Ghost {
  readonly key: string;
  readonly pose: Pose;
  readonly selected: boolean;
}

/** One candidate of the selected gap: its rows with both keys. */
export interface CandidateView {
  readonly rows: Float32Array;
  readonly frames: number;
  readonly chosen: boolean;
}

/** A trajectory of the gallery that can be picked; x, z in metres. */
export interface GalleryPathView {
  readonly points: readonly (readonly [number, number])[];
  readonly chosen: boolean;
  readonly label: string;
}

/** A drawn path by its control points, between the places of the two keys. */
export interface DrawnPathView {
  readonly from: readonly [number, number];
  readonly to: readonly [number, number];
  readonly points: readonly (readonly [number, number])[];
}

/** Everything that is shown. Fields that keep their identity are not rebuilt. */
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
  readonly galleryPaths: readonly GalleryPathView[];
  readonly drawnPath: DrawnPathView | null;
  /** The ends for drawing a first path. */
  readonly ends: Pick<DrawnPathView, "from" | "to"> | null;
  /** rotate, reach and place change `pose` by gizmos (if `editable`); draw draws a path on the ground. */
  readonly tool: Tool;
  readonly editable: boolean;
  /** The joint that is turned by the tool rotate. */
  readonly joint: number | null;
  readonly show: Readonly<Record<"trails" | "contacts" | "ghosts" | "others", boolean>>;
  readonly theme: "light" | "dark";
  /** The camera follows the character's root on the ground. */
  readonly follow: boolean;
}

export interface Events {
  /** A ghost was clicked. */
  pickKey(key: string): void;
  /** A candidate's character or root path was clicked. */
  pickCandidate(index: number): void;
  pickPath(index: number): void;
  pickJoint(joint: number | null): void;
  /**
   * `pose` as changed by a gizmo or by inverse kinematics, from the first movement of the pointer on. Escape during a drag
   * ends it with the initial pose.
   */
  changePose(pose: Pose, phase: Phase): void;
  /** The control points of the path were dragged, added (double click), removed (Delete), or drawn. */
  changeDrawnPath(points: (readonly [number, number])[], phase: Phase): void;
}
