/** Places poses of the library as keys. */

import { lastFrame } from "../document/document";
import { groundOf, headingOf, moveOnGround, turnAboutHips } from "../pose/place";
import { row } from "../rig";
import type { Studio } from "../studio.svelte";

/** Distance from the last key to a pose that follows it, in hip heights, and the time between them in seconds. */
const AHEAD = 1.6;
const LATER = 1.5;

/** Makes a pose of the library the key at the playhead, with the current place and facing. After the last key, it goes ahead of it. */
export function putLibraryPose(studio: Studio, index: number): void {
  const { document, rig, pose } = studio;
  const { frame } = studio.playback;
  const { library } = studio.answers;
  if (!document || !rig || !library || !pose) return;
  const last = lastFrame(document);
  const follows = frame >= last;
  const heading = headingOf(rig, pose);
  const [x, z] = groundOf(rig, pose);
  const ahead = follows ? AHEAD * rig.size : 0;
  const turned = turnAboutHips(rig, row(library.poses, rig.stride, index), heading);
  const [fromX, fromZ] = groundOf(rig, turned);
  const placed = moveOnGround(rig, turned, x + ahead * Math.sin(heading) - fromX, z + ahead * Math.cos(heading) - fromZ);
  const at = follows ? Math.max(frame, last + Math.round(LATER * document.rate)) : frame;
  studio.putPose(placed, at, `Put “${library.names[index]}”`);
}
