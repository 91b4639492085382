/** Paths of the selected gap. */

import { groundOf } from "../pose/place";
import type { GapSettings } from "../protocol";
import type { Studio } from "../studio.svelte";
import type { DrawnPathView, Phase } from "../viewport/types";

type Ground = readonly [number, number];

/** Makes a trajectory of the gallery the path. */
export function pickPath(studio: Studio, index: number): void {
  const gap = studio.selectedGap;
  const found = studio.answers.paths?.found[index];
  if (gap && found) studio.setGap(gap.id, { path: found.path }, "Choose a path");
}

/** Changes the control points of the drawn path. */
export function changeDrawnPath(studio: Studio, points: readonly Ground[], phase: Phase): void {
  const gap = studio.selectedGap;
  if (!gap) return;
  const path: GapSettings["path"] =
    points.length === 0
      ? { kind: "auto" }
      : { kind: "waypoints", points: points.map(([x, z]) => [x, z]), times: null, facing: null, drawn: true };
  studio.setGap(gap.id, { path }, "Draw a path", `path:${gap.id}`);
  if (phase === "end") studio.release();
}

/** The places on the ground where the selected gap starts and ends. */
export function endsOf(studio: Studio): { readonly from: Ground; readonly to: Ground } | null {
  const { selectedGap: gap, rig } = studio;
  return gap && rig && { from: groundOf(rig, studio.poseOf(gap.left)), to: groundOf(rig, studio.poseOf(gap.right)) };
}

export function drawnPathOf(studio: Studio): DrawnPathView | null {
  const path = studio.selectedGap?.settings.path;
  const ends = endsOf(studio);
  return ends && path?.kind === "waypoints" && path.drawn ? { ...ends, points: path.points } : null;
}
