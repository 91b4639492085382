/** The motion of a document: the pose at a frame, and the rows of a range. */

import type { Document, Gap, Key } from "../document/document";
import { firstFrame, gapAtFrame, gapsOf, keyAtFrame, lastFrame } from "../document/document";
import type { Pose } from "../rig";
import { row } from "../rig";
import { mix } from "./poses";

/** What is shown: the frames of each gap, and the pose of each key. */
export interface Shown {
  rows(gap: Gap): Float32Array;
  pose(key: Key): Pose;
}

/** The pose at a whole frame; before the first key and after the last one, that key's. */
export function poseAt(document: Document, shown: Shown, frame: number): Pose {
  const at = Math.max(firstFrame(document), Math.min(lastFrame(document), frame));
  const key = keyAtFrame(document, at);
  if (key) return shown.pose(key);
  const gap = gapAtFrame(document, at) as Gap;
  return row(shown.rows(gap), document.stride, at - gap.left.frame - 1);
}

/** The pose at any time in frames. */
export function poseBetween(document: Document, shown: Shown, time: number, joints: number): Pose {
  const low = Math.floor(time);
  const a = poseAt(document, shown, low);
  return time === low ? a : mix(a, poseAt(document, shown, low + 1), time - low, joints);
}

/** The source frame that a frame of the document shows unchanged, or null. */
export function sourceAt(document: Document, frame: number): number | null {
  const key = keyAtFrame(document, frame);
  if (key) return key.source;
  const gap = gapAtFrame(document, frame);
  return gap?.settings.method === "clip" ? (gap.left.source as number) + frame - gap.left.frame : null;
}

/** The rows of the frames from `first` to `last`, both included. */
export function rowsBetween(document: Document, shown: Shown, first: number, last: number): Float32Array {
  const { stride } = document;
  const made = new Float32Array((last - first + 1) * stride);
  const put = (rows: Float32Array, frame: number) => {
    const count = rows.length / stride;
    const from = Math.max(first, frame);
    const to = Math.min(last + 1, frame + count);
    if (from < to) made.set(rows.subarray((from - frame) * stride, (to - frame) * stride), (from - first) * stride);
  };
  for (const key of document.keys) put(shown.pose(key), key.frame);
  for (const gap of gapsOf(document)) {
    if (gap.right.frame < first || gap.left.frame > last) continue;
    put(shown.rows(gap), gap.left.frame + 1);
  }
  return made;
}

/** The whole motion for export: its rows, and which of them are unchanged source frames. */
export function wholeMotion(document: Document, shown: Shown): { rows: Float32Array; own: [number, number][] } {
  const first = firstFrame(document);
  const last = lastFrame(document);
  const own: [number, number][] = [];
  for (let frame = first; frame <= last; frame++) {
    const source = sourceAt(document, frame);
    const key = keyAtFrame(document, frame);
    if (source !== null && (!key || shown.pose(key) === key.pose)) own.push([frame - first, source]);
  }
  return { rows: rowsBetween(document, shown, first, last), own };
}
