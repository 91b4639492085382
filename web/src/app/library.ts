/** Poses of the library, placed where a key is wanted. */

import { lastFrame } from "../document/document";
import { groundOf, headingOf, moveOnGround, turnAboutHips } from "../pose/place";
import { row } from "../rig";
import type { Studio } from "../studio.svelte";

/** How far ahead of the last key a pose is put that is to follow it, in hip heights; and after how many seconds. */
const AHEAD = 1.6;
const LATER = 1.5;

/** The library's pose `index` as the key at the playhead, where the figure stands and looks; after the last key, ahead of it. */
export function putLibraryPose(studio: Studio, index: number): void {
  const { document, rig, pose, frame } = studio;
  const { library } = studio.answers;
  if (!document || !rig || !library || !pose) return;
  const last = lastFrame(document);
  const follows = frame >= last;
  const heading = headingOf(rig, pose);
  const [x, z] = groundOf(rig, pose);
  const way = follows ? AHEAD * rig.size : 0;
  const turned = turnAboutHips(rig, row(library.poses, rig.stride, index), heading);
  const [fromX, fromZ] = groundOf(rig, turned);
  const placed = moveOnGround(rig, turned, x + way * Math.sin(heading) - fromX, z + way * Math.cos(heading) - fromZ);
  const at = follows ? Math.max(frame, last + Math.round(LATER * document.rate)) : frame;
  studio.putPose(placed, at, `Put “${library.names[index]}”`);
}
