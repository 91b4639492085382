/** The motion of a document: the pose at a frame, and the rows of a range. */

import type { Document, Gap } from "../document/document";
import { firstFrame, gapAtFrame, gapsOf, keyAtFrame, lastFrame } from "../document/document";
import type { Pose } from "../rig";
import { row } from "../rig";
import { mix } from "./poses";

type RowsOf = (gap: Gap) => Float32Array;

/** The pose at a whole frame; before the first key and after the last one, that key's. */
export function poseAt(document: Document, rowsOf: RowsOf, frame: number): Pose {
  const at = Math.max(firstFrame(document), Math.min(lastFrame(document), frame));
  const key = keyAtFrame(document, at);
  if (key) return key.pose;
  const gap = gapAtFrame(document, at) as Gap;
  return row(rowsOf(gap), document.stride, at - gap.left.frame - 1);
}

/** The pose at any time in frames. */
export function poseBetween(document: Document, rowsOf: RowsOf, time: number, joints: number): Pose {
  const low = Math.floor(time);
  const a = poseAt(document, rowsOf, low);
  return time === low ? a : mix(a, poseAt(document, rowsOf, low + 1), time - low, joints);
}

/** The source frame that a frame of the document shows unchanged, or null. */
export function sourceAt(document: Document, frame: number): number | null {
  const key = keyAtFrame(document, frame);
  if (key) return key.source;
  const gap = gapAtFrame(document, frame);
  return gap?.settings.method === "clip" ? (gap.left.source as number) + frame - gap.left.frame : null;
}

/** The rows of the frames from `first` to `last`, both included. */
export function rowsBetween(document: Document, rowsOf: RowsOf, first: number, last: number): Float32Array {
  const { stride } = document;
  const made = new Float32Array((last - first + 1) * stride);
  const put = (rows: Float32Array, frame: number) => {
    const count = rows.length / stride;
    const from = Math.max(first, frame);
    const to = Math.min(last + 1, frame + count);
    if (from < to) made.set(rows.subarray((from - frame) * stride, (to - frame) * stride), (from - first) * stride);
  };
  for (const key of document.keys) put(key.pose, key.frame);
  for (const gap of gapsOf(document)) {
    if (gap.right.frame < first || gap.left.frame > last) continue;
    put(rowsOf(gap), gap.left.frame + 1);
  }
  return made;
}

/** The whole motion for export: its rows, and which of them are unchanged source frames. */
export function wholeMotion(document: Document, rowsOf: RowsOf): { rows: Float32Array; own: [number, number][] } {
  const first = firstFrame(document);
  const last = lastFrame(document);
  const own: [number, number][] = [];
  for (let frame = first; frame <= last; frame++) {
    const source = sourceAt(document, frame);
    if (source !== null) own.push([frame - first, source]);
  }
  return { rows: rowsBetween(document, rowsOf, first, last), own };
}
