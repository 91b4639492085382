/** The points that the camera frames. */

import { Box3, Vector3 } from "three";
import { aboveHips, forward, placeOf } from "../../pose/kinematics";
import { headingOf } from "../../pose/place";
import type { Pose, Rig } from "../../rig";
import { shiftOf } from "../characters/candidates";
import type { View } from "../types";

/** Ends of a box around a pose, a little larger than its joints. */
function around(rig: Rig, pose: Pose, shift = new Vector3()): Vector3[] {
  const globals = forward(rig, pose);
  const joints = rig.parents.map((_, joint) => joint).filter((joint) => !aboveHips(rig, joint));
  const { min, max } = new Box3()
    .setFromPoints(joints.map((joint) => placeOf(globals, joint)))
    .expandByScalar(0.12 * rig.size)
    .translate(shift);
  return [0, 1, 2, 3, 4, 5, 6, 7].map(
    (i) => new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z),
  );
}

export function characterPoints(view: View): Vector3[] {
  return view.rig && view.pose ? around(view.rig, view.pose) : [];
}

export function allPoints(view: View): Vector3[] {
  const { rig } = view;
  if (!rig) return [];
  const found = characterPoints(view);
  if (view.show.ghosts) found.push(...view.ghosts.flatMap(({ pose }) => around(rig, pose)));
  view.candidates.forEach(({ rows, frames }, index) => {
    const shift = shiftOf(rig, view.candidates, view.spread, index);
    for (const frame of [0, view.candidateFrame, frames - 1]) {
      const at = Math.max(0, Math.min(frames - 1, Math.round(frame))) * rig.stride;
      found.push(...around(rig, rows.subarray(at, at + rig.stride), shift));
    }
  });
  const ground = [
    ...view.galleryPaths.flatMap(({ points }) => points),
    ...(view.drawnPath ? [view.drawnPath.from, ...view.drawnPath.points, view.drawnPath.to] : []),
  ];
  found.push(...ground.map(([x, z]) => new Vector3(x, 0, z)));
  return found;
}

/** The best direction to look at a pose: from the front, a little to its left and above. */
export function bestSide(rig: Rig, pose: Pose): Vector3 {
  const angle = headingOf(rig, pose) + 0.72;
  return new Vector3(Math.sin(angle), 0.3, Math.cos(angle));
}
